// Inputs that are streams.
#include "io/input_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <future>
#include <thread>

namespace rbvh {
namespace {

TEST(InputStream, StopEndsAReadThatWaits) {
  std::string pattern = (std::filesystem::temp_directory_path() / "rbvh_input_XXXXXX").string();
  const std::filesystem::path folder = mkdtemp(pattern.data());
  const std::string pipe = folder / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  auto opening = std::async(std::launch::async, [&] { return std::ofstream(pipe); });
  InputStream in(pipe);
  std::ofstream writer = opening.get();
  writer << "abc" << std::flush;
  std::array<std::byte, 8> bytes{};
  auto reading = std::async(std::launch::async, [&] { return in.read(bytes); });
  std::this_thread::sleep_for(std::chrono::milliseconds(30));
  EXPECT_EQ(reading.wait_for(std::chrono::seconds(0)), std::future_status::timeout);
  in.stop();
  EXPECT_EQ(reading.get(), 3u);
  EXPECT_EQ(in.read(bytes), 0u);
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace rbvh
