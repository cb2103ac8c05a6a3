// The device behind pipeline/device/device.h: choosing one, kernels, buffers, and every error.
#include "pipeline/device/device.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <numeric>
#include <thread>

#include "pipeline/base/error.h"
#include "pipeline/device/embedded_kernels.h"
#include "pipeline/device/kernel_source.h"

namespace rbvh {
namespace {

class DeviceTest : public testing::Test {
 protected:
  DeviceTest() {
    unsetenv("RBVH_DEVICE");
    setenv("RBVH_KERNELS", RBVH_SOURCE "/tests/kernels", 1);
  }
};

/// The error's text, or nothing if there was none; the code must be as expected.
template <class Call>
std::string error_of(ErrorKind code, Call&& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), code) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "no error";
  return {};
}

TEST_F(DeviceTest, ListsAndOpensEveryWay) {
  const std::vector<DeviceInfo> devices = list_devices();
  ASSERT_FALSE(devices.empty()) << "these tests need an OpenCL device, such as PoCL";
  for (std::size_t i = 0; i < devices.size(); ++i) {
    EXPECT_EQ(devices[i].index, static_cast<int>(i));
    EXPECT_GT(devices[i].memory_bytes, 0u);
    EXPECT_GT(devices[i].max_buffer_bytes, 0u);
    EXPECT_GT(devices[i].compute_units, 0u);
    EXPECT_EQ(Device::open(std::to_string(i)).info().index, static_cast<int>(i));
    const int by_name = Device::open(devices[i].name.substr(1)).info().index;
    EXPECT_EQ(devices[static_cast<std::size_t>(by_name)].name, devices[i].name);
    EXPECT_EQ(Device::open(devices[i].is_cpu ? "CPU" : "gpu").info().is_cpu, devices[i].is_cpu);
  }
}

TEST_F(DeviceTest, EnvironmentIsTheDefaultChoice) {
  setenv("RBVH_DEVICE", "no-such-device", 1);
  EXPECT_NE(error_of(ErrorKind::kDevice, [] { Device::open(); }).find("no-such-device"), std::string::npos);
  EXPECT_NO_THROW(Device::open("0"));  // a choice that is made goes before it
  setenv("RBVH_DEVICE", "0", 1);
  EXPECT_EQ(Device::open().info().index, 0);
}

TEST_F(DeviceTest, NoSuchDevice) {
  for (const char* choice : {"99", "-1", "0x", "no-such-device"}) {
    const std::string what = error_of(ErrorKind::kDevice, [&] { Device::open(choice); });
    EXPECT_EQ(what.find("no usable OpenCL device"), 0u) << what;
    EXPECT_EQ(what.find('\n'), std::string::npos);
  }
}

TEST_F(DeviceTest, RunsKernelsWithIncludesAndScalars) {
  const Device device = Device::open();
  std::vector<std::uint32_t> values(1001);
  std::iota(values.begin(), values.end(), 0u);
  const Buffer<std::uint32_t> in(device, values);
  const Buffer<std::uint32_t> out(device, values.size());
  device.kernel("device_probe", "probe_add").run(values.size(), 64, in, 7u, out, 1001u);
  const std::vector<std::uint32_t> got = out.read();
  for (std::size_t i = 0; i < got.size(); ++i) ASSERT_EQ(got[i], i + 1007);
}

TEST_F(DeviceTest, BuffersReadWriteFillCopyAtOffsets) {
  const Device device = Device::open();
  Buffer<std::uint16_t> a(device, 10), b(device, 10);
  a.fill(0xab);
  b.fill(0);
  const std::uint16_t three[] = {1, 2, 3};
  a.write(three, 4);
  b.copy_from(a, 4, 6, 3);
  EXPECT_EQ(b.read(), (std::vector<std::uint16_t>{0, 0, 0, 0, 0, 0, 0xabab, 1, 2, 3}));
  std::vector<std::uint16_t> part(2);
  b.read(part, 8);
  EXPECT_EQ(part, (std::vector<std::uint16_t>{2, 3}));
}

// On a CPU these have memory of their own (huge_pages.h), which has to outlive commands under way.
TEST_F(DeviceTest, LargeBuffersKeepTheirBytesUntilTheLastCommandIsDone) {
  const Device device = Device::open();
  std::vector<std::uint32_t> values(3'000'001), read(values.size());
  std::iota(values.begin(), values.end(), 5u);
  for (int turn = 0; turn < 20; ++turn) {
    Buffer<std::uint32_t> copied(device, values.size());
    {
      const Buffer<std::uint32_t> written(device, values);
      copied.copy_from(written, values.size());
    }
    copied.read(std::span(read));
    ASSERT_EQ(read, values);
  }
}

TEST_F(DeviceTest, EmptyAndNullBuffers) {
  const Device device = Device::open();
  Buffer<std::uint32_t> empty(device, 0), none;
  empty.fill(1);
  empty.write({});
  empty.copy_from(none, 0);
  EXPECT_TRUE(empty.read().empty());
  EXPECT_TRUE(none.read().empty());
  const Buffer<std::uint32_t> out(device, 1);
  const Kernel kernel = device.kernel("device_probe", "probe_null");
  kernel.run(1, 1, none, out);
  EXPECT_EQ(out.read()[0], 2u);
  kernel.run(1, 1, empty, out);
  EXPECT_EQ(out.read()[0], 1u);
  kernel.run(0, 1, none, out);  // no work-items: nothing happens
  EXPECT_EQ(out.read()[0], 1u);
}

TEST_F(DeviceTest, BuffersAreAlignedToCacheLines) {
  const Device device = Device::open();
  const Buffer<std::uint32_t> out(device, 1);
  for (const std::size_t bytes : {1u, 63u, 100u, 4097u, 1000001u}) {
    const Buffer<unsigned char> buffer(device, bytes);
    device.kernel("device_probe", "probe_alignment").run(1, 1, buffer, out);
    EXPECT_EQ(out.read()[0], 0u) << bytes;
  }
}

TEST_F(DeviceTest, CopiesOfAKernelMayRunFromSeveralThreads) {
  const Device device = Device::open();
  const Kernel kernel = device.kernel("device_probe", "probe_add");
  const Buffer<std::uint32_t> zero(device, std::vector<std::uint32_t>(1));
  std::vector<Buffer<std::uint32_t>> outs;
  for (int i = 0; i < 200; ++i) outs.emplace_back(device, 1);
  {
    std::vector<std::jthread> threads;
    for (unsigned t = 0; t < 4; ++t) {
      threads.emplace_back([&, copy = kernel, t] {
        for (unsigned i = t; i < outs.size(); i += 4) copy.run(1, 1, zero, i, outs[i], 1u);
      });
    }
  }
  for (unsigned i = 0; i < outs.size(); ++i) ASSERT_EQ(outs[i].read()[0], i + 1000);
}

TEST_F(DeviceTest, ABuildErrorNamesFileLineAndDevice) {
  const Device device = Device::open();
  std::string whole_log;
  set_build_log_sink([&](std::string_view, std::string_view log) { whole_log = log; });
  const std::string what =
      error_of(ErrorKind::kDevice, [&] { device.kernel("device_broken", "broken", "-DSOME_WORD=1"); });
  set_build_log_sink({});
  for (const char* word : {"device_broken.cl", "clBuildProgram", "CL_BUILD_PROGRAM_FAILURE",
                           "broken_include.h:2", "no_such_name", "-DSOME_WORD=1"}) {
    EXPECT_NE(what.find(word), std::string::npos) << word << " in: " << what;
  }
  EXPECT_NE(what.find(device.info().name), std::string::npos);
  EXPECT_EQ(what.find('\n'), std::string::npos);
  EXPECT_NE(whole_log.find("no_such_name"), std::string::npos);
}

TEST_F(DeviceTest, MissingFilesAndEntriesAreNamed) {
  const Device device = Device::open();
  EXPECT_NE(error_of(ErrorKind::kDevice, [&] { device.kernel("no_such_file", "x"); }).find("no_such_file.cl"),
            std::string::npos);
  const std::string what =
      error_of(ErrorKind::kDevice, [&] { device.kernel("device_probe", "no_such_entry"); });
  EXPECT_NE(what.find("no_such_entry"), std::string::npos) << what;
  EXPECT_NE(what.find("CL_INVALID_KERNEL_NAME"), std::string::npos) << what;
}

TEST_F(DeviceTest, WrongArgumentsAreAnErrorNotACrash) {
  const Device device = Device::open();
  const Buffer<std::uint32_t> out(device, 1);
  const Kernel kernel = device.kernel("device_probe", "probe_add");
  EXPECT_NE(error_of(ErrorKind::kDevice, [&] { kernel.run(1, 1, out); }).find("probe_add"),
            std::string::npos);
  error_of(ErrorKind::kDevice, [&] { kernel.run(1, 1, out, std::uint8_t{1}, out, 1u); });
}

TEST_F(DeviceTest, TooMuchMemoryIsOverBudget) {
  const Device device = Device::open();
  error_of(ErrorKind::kBudget, [&] {
    Buffer<unsigned char>(device, static_cast<std::size_t>(device.info().max_buffer_bytes) + 1);
  });
  const std::uint64_t before = device.memory_use().bytes;
  {
    const Buffer<unsigned char> a(device, 1000);
    EXPECT_EQ(device.memory_use().bytes, before + 1000);
    device.set_memory_limit(before + 1500);
    EXPECT_NE(error_of(ErrorKind::kBudget, [&] { Buffer<unsigned char>(device, 501); }).find("budget"),
              std::string::npos);
    EXPECT_NO_THROW(Buffer<unsigned char>(device, 500));
    device.set_memory_limit(0);
  }
  EXPECT_EQ(device.memory_use().bytes, before);
  EXPECT_GE(device.memory_use().peak_bytes, before + 1500);
}

TEST_F(DeviceTest, TheCompileNoticeComesOnceForLongCompiles) {
  const Device device = Device::open();
  const Buffer<float> a(device, 64);
  std::string line;
  int notices = 0;
  set_compile_notice([&](std::string_view text) {
    line = text;
    ++notices;
  });
  // Constants that no earlier run has seen, so that no cache has the code.
  auto seed = std::chrono::system_clock::now().time_since_epoch().count() % 1000000000;
  const auto compile = [&] {
    const auto start = std::chrono::steady_clock::now();
    device.kernel("device_probe", "probe_slow", "-DPROBE_SLOW=" + std::to_string(++seed) + ".0f")
        .run(64, 64, a);
    device.finish();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  const double seconds = compile();
  compile();
  set_compile_notice({});
  if (seconds < 1) GTEST_SKIP() << "this device compiles too fast to tell";
  EXPECT_EQ(notices, 1);
  EXPECT_NE(line.find("compiling kernels"), std::string::npos);
}

TEST(KernelSource, EveryEmbeddedFileIsWholeAndKeepsItsLines) {
  unsetenv("RBVH_KERNELS");
  ASSERT_GT(kEmbeddedKernelCount, 0u);
  for (std::size_t i = 0; i < kEmbeddedKernelCount; ++i) {
    const std::string name = kEmbeddedKernels[i].name;
    const std::string folder = name.starts_with("rbvh/") ? RBVH_SOURCE "/include/" : RBVH_SOURCE "/kernels/";
    std::ifstream file(folder + name, std::ios::binary);
    EXPECT_EQ(std::string(std::istreambuf_iterator<char>(file), {}), kEmbeddedKernels[i].text) << name;
    EXPECT_EQ(kernel_source(name).find("#line 1 \"kernels/" + name + "\"\n"), 0u);
  }
}

}  // namespace
}  // namespace rbvh
