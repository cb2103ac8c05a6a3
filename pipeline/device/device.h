// What runs on a Device: kernels and their memory. This folder alone includes CL headers: everything else
// launches kernels through Device, Buffer and Kernel.
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

#include "rbvh/device.h"

namespace rbvh {

namespace device_detail {
struct KernelState;
struct Argument {
  const void* data;  ///< the scalar's bytes, or a BufferState
  std::size_t size;  ///< 0: a buffer
};
}  // namespace device_detail

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
