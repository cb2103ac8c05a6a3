// Prefix sum, radix sort and segmented reduction against plain loops on the host, on the device as it is and
// with the split meant for a GPU.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "pipeline/device/device.h"
#include "pipeline/device/prefix_sum.h"
#include "pipeline/device/radix_sort.h"
#include "pipeline/device/segmented_reduce.h"
#include "tests/property.h"

namespace rbvh {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
const std::size_t kSizes[] = {0, 1, 2, 3, 31, 33, 255, 256, 257, 2047, 2049, 5001, 65536, 1234567};

class Primitives : public testing::TestWithParam<bool> {
 protected:
  Device device = GetParam() ? Device::open().as_gpu() : Device::open();
  std::mt19937_64 random{property_seed()};

  static void SetUpTestSuite() {
    set_build_log_sink(
        [](std::string_view file, std::string_view log) { ADD_FAILURE() << file << ": " << log; });
  }
};

std::vector<std::uint32_t> random_words(std::mt19937_64& random, std::size_t count, std::uint32_t most) {
  std::vector<std::uint32_t> words(count);
  for (std::uint32_t& word : words) word = static_cast<std::uint32_t>(random() % (std::uint64_t{most} + 1));
  return words;
}

TEST_P(Primitives, PrefixSum) {
  for (const std::size_t count : kSizes) {
    const std::vector<std::uint32_t> in = random_words(random, count, 0xffffffffu);
    std::vector<std::uint32_t> expected(count + 1);
    for (std::size_t i = 0; i < count; ++i) expected[i + 1] = expected[i] + in[i];
    Buffer<std::uint32_t> in_buffer(device, in), out(device, count + 1);
    out.fill(0xcd);
    prefix_sum(device, in_buffer, count, out);
    ASSERT_EQ(out.read(), expected) << count;
    out.write(in);
    prefix_sum(device, out, count, out);
    ASSERT_EQ(out.read(), expected) << count << " in place";
  }
}

template <class Key>
void check_sort(const Device& device, std::mt19937_64& random, std::size_t count, Key mask, unsigned bits) {
  std::vector<Key> keys(count);
  for (Key& key : keys) key = static_cast<Key>(random()) & mask;
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  Buffer<Key> key_buffer(device, keys);
  Buffer<std::uint32_t> value_buffer(device, order);
  radix_sort(device, key_buffer, value_buffer, count, bits);
  const Key looked_at = bits >= 8 * sizeof(Key) ? ~Key{0} : static_cast<Key>((Key{1} << bits) - 1);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return (keys[a] & looked_at) < (keys[b] & looked_at);
  });
  ASSERT_EQ(value_buffer.read(), order) << count << " bits " << bits;
  std::vector<Key> sorted(count);
  for (std::size_t i = 0; i < count; ++i) sorted[i] = keys[order[i]];
  ASSERT_EQ(key_buffer.read(), sorted) << count << " bits " << bits;
}

TEST_P(Primitives, RadixSortIsStableAndSorted) {
  for (const std::size_t count : kSizes) {
    check_sort<std::uint32_t>(device, random, count, ~0u, 32);
    check_sort<std::uint32_t>(device, random, count, 0x00030003u, 32);  // many equal keys
    check_sort<std::uint64_t>(device, random, count, ~0ull, 64);
  }
  for (const unsigned bits : {0u, 1u, 7u, 8u, 12u, 24u, 30u}) {
    check_sort<std::uint32_t>(device, random, 3001, ~0u, bits);
    check_sort<std::uint64_t>(device, random, 3001, ~0ull, bits + 30);
  }
}

TEST_P(Primitives, RadixSortLeavesWhatIsBeyondCount) {
  Buffer<std::uint32_t> keys(device, std::vector<std::uint32_t>{3, 2, 1, 0}), values(device, 4);
  values.fill(0);
  radix_sort(device, keys, values, 3, 8);
  EXPECT_EQ(keys.read(), (std::vector<std::uint32_t>{1, 2, 3, 0}));
}

/// Offsets of random segments over `count` values: some empty, some of one value, some long; not all values
/// are in one.
std::vector<std::uint32_t> random_offsets(std::mt19937_64& random, std::size_t count) {
  std::vector<std::uint32_t> offsets;
  std::size_t at = random() % 3 == 0 ? std::min<std::size_t>(count, 5) : 0;
  const std::size_t longest[] = {1, 4, 100, 1000, 100000};
  while (true) {
    offsets.push_back(static_cast<std::uint32_t>(at));
    if (at == count && random() % 2 == 0) break;
    if (random() % 50 == 0 && count > 0 && at > count * 3 / 4) break;
    at = std::min(count, at + random() % (longest[random() % 5] + 1));
  }
  return offsets;
}

/// The documented order: within blocks of 256 values, then block after block.
float reduce_on_host(Reduction reduction, const std::vector<float>& values, std::size_t stride,
                     std::size_t component, std::size_t begin, std::size_t end) {
  const float identity = reduction == Reduction::kSum   ? 0.0f
                         : reduction == Reduction::kMin ? kInfinity
                                                        : -kInfinity;
  const auto join = [&](float a, float b) {
    if (reduction == Reduction::kSum) return a + b;
    return (reduction == Reduction::kMin ? b < a : b > a) ? b : a;
  };
  float result = identity;
  for (std::size_t i = begin; i < end;) {
    const std::size_t block_end = std::min(end, (i / 256 + 1) * 256);
    float part = identity;
    const std::size_t first = i;
    for (; i < block_end; ++i) part = join(part, values[i * stride + component]);
    result = first == begin ? part : join(result, part);
  }
  return result;
}

TEST_P(Primitives, SegmentedReduceIsExactlyTheDocumentedOrder) {
  std::normal_distribution<float> normal;
  for (const std::size_t count : kSizes) {
    for (const std::uint32_t components : {1u, 2u, 4u, 8u}) {
      if (count > 100000 && components == 8) continue;
      std::vector<float> values(count * components);
      for (float& value : values) value = normal(random);
      if (count > 2000) values[random() % values.size()] = std::numeric_limits<float>::quiet_NaN();
      const std::vector<std::uint32_t> offsets = random_offsets(random, count);
      const std::size_t segments = offsets.size() - 1;
      const Buffer<float> value_buffer(device, values);
      const Buffer<std::uint32_t> offset_buffer(device, offsets);
      for (const Reduction reduction : {Reduction::kSum, Reduction::kMin, Reduction::kMax}) {
        Buffer<float> out(device, segments * components);
        out.fill(0xcd);
        segmented_reduce(device, reduction, value_buffer, count, components, offset_buffer, segments, out);
        const std::vector<float> got = out.read();
        for (std::size_t i = 0; i < got.size(); ++i) {
          const std::size_t s = i / components;
          const float expected =
              reduce_on_host(reduction, values, components, i % components, offsets[s], offsets[s + 1]);
          ASSERT_TRUE(std::memcmp(&got[i], &expected, sizeof(float)) == 0 ||
                      (std::isnan(got[i]) && std::isnan(expected)))
              << got[i] << " is not " << expected << ", segment " << s << " of " << segments << ", " << count
              << " x " << components << ", reduction " << static_cast<int>(reduction);
        }
      }
    }
  }
}

TEST_P(Primitives, SegmentOffsets) {
  for (const std::size_t count : kSizes) {
    for (const std::size_t segments : {std::size_t{1}, std::size_t{7}, count / 3 + 1, 2 * count + 3}) {
      std::vector<std::uint32_t> ids = random_words(random, count, static_cast<std::uint32_t>(segments - 1));
      std::sort(ids.begin(), ids.end());
      std::vector<std::uint32_t> expected(segments + 1);
      for (std::size_t s = 0; s <= segments; ++s) {
        expected[s] = static_cast<std::uint32_t>(std::lower_bound(ids.begin(), ids.end(), s) - ids.begin());
      }
      Buffer<std::uint32_t> id_buffer(device, ids), offsets(device, segments + 1);
      offsets.fill(0xcd);
      segment_offsets(device, id_buffer, count, segments, offsets);
      ASSERT_EQ(offsets.read(), expected) << count << " ids, " << segments << " segments";
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Split, Primitives, testing::Values(false, true),
                         [](const auto& info) { return info.param ? "AsGpu" : "AsItIs"; });

}  // namespace
}  // namespace rbvh
