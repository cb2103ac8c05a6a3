// The OpenCL device behind plain types. This folder alone includes CL headers: everything else launches
// kernels through Device, Buffer and Kernel. Every CL failure becomes an Error with the call, the code's
// name, the device and, for a kernel that does not build, the build log.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

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
struct KernelState;
struct Argument {
  const void* data;  ///< the scalar's bytes, or a BufferState
  std::size_t size;  ///< 0: a buffer
};
}  // namespace device_detail

template <class T>
class Buffer;

/// A compiled kernel entry point. Cheap to copy. May be run from several threads at once.
class Kernel {
 public:
  /// Enqueues `global` work-items (rounded up to a multiple of `local`; kernels check their id against a
  /// count argument). Arguments are Buffers or trivially copyable scalars and structs, in the kernel's order;
  /// a default-constructed Buffer is a null pointer to the kernel. Returns before the kernel is done.
  template <class... Args>
  void run(std::size_t global, std::size_t local, const Args&... args) const {
    const device_detail::Argument list[] = {argument(args)..., {nullptr, 0}};
    run_arguments(global, local, std::span(list, sizeof...(Args)));
  }

 private:
  friend class Device;
  template <class T>
  static device_detail::Argument argument(const Buffer<T>& buffer) {
    return {buffer.state_.get(), 0};
  }
  template <class T>
  static device_detail::Argument argument(const T& value) {
    static_assert(std::is_trivially_copyable_v<T> && !std::is_pointer_v<T>);
    return {&value, sizeof(T)};
  }
  void run_arguments(std::size_t global, std::size_t local,
                     std::span<const device_detail::Argument> arguments) const;
  std::shared_ptr<device_detail::KernelState> state_;
};

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

/// Device memory for `size()` elements; shared on copy, freed with the last copy. read and write block; the
/// rest is enqueued. A range beyond the buffer's end is a bug (RBVH_CHECK).
/// Default-constructed: no memory. Allocation throws Error(kBudget) where the device cannot hold it.
template <class T>
class Buffer {
 public:
  static_assert(std::is_trivially_copyable_v<T>);
  Buffer() = default;
  Buffer(const Device& device, std::size_t count)
      : state_(device.allocate(count * sizeof(T))), count_(count) {}
  Buffer(const Device& device, std::span<const T> values) : Buffer(device, values.size()) { write(values); }
  Buffer(const Device& device, const std::vector<T>& values) : Buffer(device, std::span<const T>(values)) {}

  std::size_t size() const { return count_; }
  std::size_t size_bytes() const { return count_ * sizeof(T); }
  void write(std::span<const T> values, std::size_t at = 0) {
    Device::write_bytes(state_.get(), at * sizeof(T), values.data(), values.size_bytes(), true);
  }
  void read(std::span<T> values, std::size_t at = 0) const {
    Device::read_bytes(state_.get(), at * sizeof(T), values.data(), values.size_bytes(), true);
  }
  /// As write() and read(), but enqueued: waiting costs more than a few kilobytes. `values` must stay where
  /// they are, and what they are, until something else has waited for the device.
  void enqueue_write(std::span<const T> values, std::size_t at = 0) {
    Device::write_bytes(state_.get(), at * sizeof(T), values.data(), values.size_bytes(), false);
  }
  void enqueue_read(std::span<T> values, std::size_t at = 0) const {
    Device::read_bytes(state_.get(), at * sizeof(T), values.data(), values.size_bytes(), false);
  }
  std::vector<T> read() const {
    std::vector<T> values(count_);
    read(values);
    return values;
  }
  /// Sets every byte.
  void fill(unsigned char byte) { Device::fill_bytes(state_.get(), count_ * sizeof(T), byte); }
  void copy_from(const Buffer& from, std::size_t count, std::size_t at = 0, std::size_t from_at = 0) {
    Device::copy_bytes(state_.get(), at * sizeof(T), from.state_.get(), from_at * sizeof(T),
                       count * sizeof(T));
  }

 private:
  friend class Kernel;
  std::shared_ptr<device_detail::BufferState> state_;
  std::size_t count_ = 0;
};

}  // namespace rbvh
