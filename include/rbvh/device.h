// OpenCL devices. Every OpenCL failure becomes an Error with the call, the code's name, the device and, for a
// kernel that does not build, the beginning of the build log.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#pragma GCC visibility push(default)
namespace rbvh {

struct DeviceInfo {
  int index = 0;  ///< over all platforms, as `rbvh devices` lists them
  std::string platform, name, version, driver;
  bool is_cpu = false, is_gpu = false;
  std::uint64_t memory_bytes = 0, max_buffer_bytes = 0;
  std::uint32_t compute_units = 0;
  bool has_int64_atomics = false;
};

/// Every OpenCL device of this machine; empty when there is none (never an error). A thread count set before
/// the first call bounds PoCL's own threads too; it reads that once.
std::vector<DeviceInfo> list_devices();

/// Called once, with a line for the user, when compiling kernels takes longer than a moment. By
/// default the line goes to stderr; an empty function silences it.
void set_compile_notice(std::function<void(std::string_view line)> notice);

/// Gets every build log that is not empty, whole: the errors' line carries only its beginning, and warnings
/// of a build that succeeds appear nowhere else. Nothing by default.
void set_build_log_sink(std::function<void(std::string_view file, std::string_view log)> sink);

namespace device_detail {
struct DeviceState;
struct BufferState;
}  // namespace device_detail

class Kernel;  // of the library's own
template <class T>
class Buffer;

/// One in-order queue on one device. Cheap to copy; copies share the context, the queue and the built
/// programs.
///
/// In debug builds, or with RBVH_CHECK_BOUNDS=1 in the environment when it is opened, kernels that take part
/// (kernels/common/bounds.h) check what they read by indices from data; run() then waits for them and throws
/// Error(kFailure) where one was out of bounds. RBVH_CHECK_BOUNDS=0 leaves that out of debug builds too.
class Device {
 public:
  /// `choice`: empty (RBVH_DEVICE from the environment, else the first CPU, else the first device), "cpu",
  /// "gpu", an index of list_devices(), or part of a name (case-insensitive). Throws Error(kDevice) where
  /// none fits, or where its loops end early.
  static Device open(const std::string& choice = {});

  const DeviceInfo& info() const;

  /// The same device, context and queue, but calling itself a GPU: runs the code meant for one where there is
  /// none.
  Device as_gpu() const;

  /// The entry point `entry` of kernels/<file>.cl, built once per distinct `options` (further -D words).
  /// Files in the folder named by RBVH_KERNELS take the place of the embedded ones.
  Kernel kernel(std::string_view file, std::string_view entry, const std::string& options = {}) const;

  /// Waits until everything enqueued so far is done.
  void finish() const;

  /// Bytes in buffers now, and at most so far.
  struct MemoryUse {
    std::uint64_t bytes = 0, peak_bytes = 0;
  };
  MemoryUse memory_use() const;
  /// Buffers beyond this many bytes in all throw Error(kBudget); 0: no limit but the device's own.
  void set_memory_limit(std::uint64_t bytes) const;

 private:
  template <class T>
  friend class Buffer;
  std::shared_ptr<device_detail::BufferState> allocate(std::size_t bytes) const;
  // A null state has no bytes.
  static void read_bytes(device_detail::BufferState*, std::size_t offset, void* to, std::size_t bytes,
                         bool waits);
  static void write_bytes(device_detail::BufferState*, std::size_t offset, const void* from,
                          std::size_t bytes, bool waits);
  static void fill_bytes(device_detail::BufferState*, std::size_t bytes, unsigned char value);
  static void copy_bytes(device_detail::BufferState* to, std::size_t to_offset,
                         device_detail::BufferState* from, std::size_t from_offset, std::size_t bytes);
  std::shared_ptr<device_detail::DeviceState> state_;
};

}  // namespace rbvh
#pragma GCC visibility pop
