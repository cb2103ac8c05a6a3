#include "pipeline/device/device.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <mutex>
#include <set>
#include <thread>

#include "pipeline/base/error.h"
#include "pipeline/base/huge_pages.h"
#include "pipeline/device/check_loops.h"
#include "pipeline/device/cl.h"
#include "pipeline/device/cl_error.h"
#include "pipeline/device/find_devices.h"
#include "pipeline/device/kernel_source.h"
#include "pipeline/device/prepare_pocl.h"

namespace rbvh {
namespace device_detail {

struct DeviceState {
  DeviceInfo info;
  cl::Device device;
  cl::Context context;
  cl::CommandQueue queue;
  bool check_bounds = false;                    ///< of what kernels read, see kernels/common/bounds.h
  std::mutex mutex;                             ///< guards the two below
  std::map<std::string, cl::Program> programs;  ///< by file and options
  std::set<std::string> launched;               ///< program, entry and work-group size already compiled
  std::atomic<std::uint64_t> memory{0}, memory_peak{0}, memory_limit{0};
};

struct BufferState {
  std::shared_ptr<DeviceState> device;
  cl::Buffer buffer;
  std::size_t bytes = 0;      ///< asked for
  std::size_t allocated = 0;  ///< at least 1: OpenCL has no empty buffers
  ~BufferState() { device->memory -= allocated; }
};

struct KernelState {
  std::shared_ptr<DeviceState> device;
  std::string program, entry;
  cl::Kernel kernel;
  std::mutex mutex;  ///< a cl::Kernel holds its arguments: setting them and enqueuing must be one step
};

}  // namespace device_detail

using device_detail::BufferState;
using device_detail::cl_error_name;
using device_detail::DeviceState;
using device_detail::FoundDevice;
using device_detail::guarded;
using device_detail::KernelState;
using device_detail::throw_cl;

namespace {

// --- errors

std::string in_words(std::uint64_t bytes) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f MB", static_cast<double>(bytes) / 1e6);
  return text;
}

/// The log's lines joined into one and cut: an error is one line.
std::string one_line(std::string_view log) {
  constexpr std::size_t kMost = 600;
  std::string line;
  for (const char c : log) {
    if (c == '\n' || c == '\r') {
      if (!line.empty() && line.back() != ' ') line += "; ";
    } else {
      line += c;
    }
  }
  while (line.ends_with("; ")) line.resize(line.size() - 2);
  if (line.size() > kMost) line = line.substr(0, kMost) + " ...";
  return line;
}

// --- notices

std::mutex g_hook_mutex;
std::function<void(std::string_view)> g_compile_notice = [](std::string_view line) {
  std::fprintf(stderr, "%.*s\n", static_cast<int>(line.size()), line.data());
};
std::function<void(std::string_view, std::string_view)> g_build_log_sink;
bool g_compile_notice_given = false;

void send_build_log(std::string_view file, std::string_view log) {
  if (log.find_first_not_of(" \t\r\n") == std::string_view::npos) return;
  const std::lock_guard lock(g_hook_mutex);
  if (g_build_log_sink) g_build_log_sink(file, log);
}

/// Tells the user, while it lives, that kernels are being compiled, should that take a moment.
class CompileNotice {
 public:
  explicit CompileNotice(const DeviceInfo& device)
      : thread_([this, name = device.name](const std::stop_token& stop) {
          std::unique_lock lock(mutex_);
          if (condition_.wait_for(lock, stop, kPatience, [&] { return stop.stop_requested(); })) return;
          const std::lock_guard hook_lock(g_hook_mutex);
          if (std::exchange(g_compile_notice_given, true) || !g_compile_notice) return;
          g_compile_notice("compiling kernels for " + name + " (once; " +
                           device_detail::pocl_cache_in_words() + ")...");
        }) {}

 private:
  static constexpr std::chrono::milliseconds kPatience{300};
  std::mutex mutex_;
  std::condition_variable_any condition_;
  std::jthread thread_;
};

// --- bounds

bool wants_bounds_checked() {
  if (const char* wish = std::getenv("RBVH_CHECK_BOUNDS"); wish != nullptr && *wish != '\0')
    return std::string_view(wish) != "0";
#ifdef NDEBUG
  return false;
#else
  return true;
#endif
}

/// A launch's last argument where the kernel takes part in the checks: what kernels/common/bounds.h calls
/// Bounds.
struct BoundsRecord {
  std::vector<cl_ulong> words;  ///< kHeader of a fault, then the bytes of each argument; empty: takes no part
  cl::Buffer buffer;
  static constexpr std::size_t kHeader = 3 + 8;  ///< line, element, elements, the file's name
};

BoundsRecord make_bounds_record(const KernelState& state,
                                std::span<const device_detail::Argument> arguments) {
  const DeviceState& device = *state.device;
  BoundsRecord record;
  if (!device.check_bounds || state.kernel.getInfo<CL_KERNEL_NUM_ARGS>() != arguments.size() + 1)
    return record;
  record.words.resize(BoundsRecord::kHeader);
  for (const device_detail::Argument& argument : arguments) {
    const auto* buffer = static_cast<const BufferState*>(argument.size > 0 ? nullptr : argument.data);
    record.words.push_back(buffer != nullptr ? buffer->bytes : 0);
  }
  record.buffer = cl::Buffer(device.context, CL_MEM_READ_WRITE | CL_MEM_COPY_HOST_PTR,
                             record.words.size() * sizeof record.words[0], record.words.data());
  return record;
}

/// Waits for the kernel.
void throw_if_out_of_bounds(const KernelState& state, BoundsRecord& record) {
  if (record.words.empty()) return;
  cl_ulong* words = record.words.data();
  state.device->queue.enqueueReadBuffer(record.buffer, CL_TRUE, 0, BoundsRecord::kHeader * sizeof *words,
                                        words);
  if (words[0] == 0) return;
  throw Error(ErrorKind::kFailure, reinterpret_cast<const char*>(words + 3),
              "line " + std::to_string(words[0]) + ": " + state.entry + " reads element " +
                  std::to_string(words[1]) + " of " + std::to_string(words[2]) + "; please report this");
}

// --- programs

/// x86 without AVX-512: clang warns that vectors of 16 are passed otherwise than with it. No kernel is linked
/// with what was compiled for another CPU.
constexpr const char* kNoAbiWarnings =
    "#if defined(__clang__) && defined(__x86_64__) && !defined(__AVX512F__)\n"
    "#pragma clang diagnostic ignored \"-Wpsabi\"\n"
    "#endif\n";

constexpr const char* kCheckLoops = "common/check_loops.cl";

cl::Program build_program(DeviceState& state, const std::string& file, const std::string& options) {
  // With the check of loops: in a program of its own that would cost half of what opening a device takes.
  const std::string source = kNoAbiWarnings + kernel_source(file) + kernel_source(kCheckLoops);
  const CompileNotice notice(state.info);
  cl::Program program =
      guarded(state.info, "kernels/" + file, [&] { return cl::Program(state.context, source); });
  const std::string all_options =
      std::string("-cl-std=CL1.2 ") + (state.check_bounds ? "-DRBVH_CHECK_BOUNDS " : "") + options;
  try {
    program.build(state.device, all_options.c_str());
  } catch (const cl::BuildError& error) {
    std::string log;
    for (const auto& [device, text] : error.getBuildLog()) log += text;
    send_build_log(file, log);
    throw Error(ErrorKind::kDevice, "kernels/" + file,
                std::string(error.what()) + ": " + cl_error_name(error.err()) + " on " + state.info.name +
                    " with " + all_options + ": " + one_line(log));
  } catch (const cl::Error& error) {
    throw_cl(state.info, "kernels/" + file, error);
  }
  send_build_log(file, program.getBuildInfo<CL_PROGRAM_BUILD_LOG>(state.device));
  return program;
}

}  // namespace

void set_compile_notice(std::function<void(std::string_view)> notice) {
  const std::lock_guard lock(g_hook_mutex);
  g_compile_notice = std::move(notice);
  g_compile_notice_given = false;
}

void set_build_log_sink(std::function<void(std::string_view, std::string_view)> sink) {
  const std::lock_guard lock(g_hook_mutex);
  g_build_log_sink = std::move(sink);
}

// --- Device

Device Device::open(const std::string& choice) {
  const char* environment = std::getenv("RBVH_DEVICE");
  const std::string wanted = !choice.empty() || environment == nullptr ? choice : environment;
  const std::vector<FoundDevice> devices = device_detail::find_devices();
  const FoundDevice* found = choose_device(devices, wanted);
  if (found == nullptr) {
    if (devices.empty()) {
      throw Error(
          ErrorKind::kDevice, {},
          "no usable OpenCL device on this machine; install one, such as Debian's pocl-opencl-icd, "
          "and see that its cache (POCL_CACHE_DIR, else ~/.cache) or the temporary folder can be written");
    }
    std::string names;
    for (const FoundDevice& d : devices)
      names += (names.empty() ? "" : ", ") + std::to_string(d.info.index) + " " + d.info.name;
    throw Error(ErrorKind::kDevice, {}, "no usable OpenCL device fits '" + wanted + "'; there are: " + names);
  }
  if (const std::string why = device_detail::pocl_obstacle();
      !why.empty() && found->info.platform == "Portable Computing Language")
    throw Error(ErrorKind::kDevice, {}, found->info.name + " is of no use here: " + why);
  Device device;
  device.state_ = std::make_shared<DeviceState>();
  DeviceState& state = *device.state_;
  state.info = found->info;
  state.device = found->device;
  state.check_bounds = wants_bounds_checked();
  guarded(state.info, "opening the device", [&] {
    state.context = cl::Context(state.device);
    state.queue = cl::CommandQueue(state.context, state.device);
  });
  return device;
}

const DeviceInfo& Device::info() const { return state_->info; }

Device Device::as_gpu() const {
  Device device;
  device.state_ = std::make_shared<DeviceState>();
  device.state_->info = state_->info;
  device.state_->info.is_cpu = false;
  device.state_->info.is_gpu = true;
  device.state_->device = state_->device;
  device.state_->context = state_->context;
  device.state_->queue = state_->queue;
  device.state_->check_bounds = state_->check_bounds;
  return device;
}

Kernel Device::kernel(std::string_view file, std::string_view entry, const std::string& options) const {
  const std::string name = std::string(file) + ".cl";
  const std::string key = name + " " + options;
  cl::Program program;
  {
    const std::lock_guard lock(state_->mutex);
    auto at = state_->programs.find(key);
    if (at == state_->programs.end())
      at = state_->programs.emplace(key, build_program(*state_, name, options)).first;
    program = at->second;
  }
  const auto make = [&](std::string_view of) {
    Kernel kernel;
    kernel.state_ = std::make_shared<KernelState>();
    KernelState& state = *kernel.state_;
    state.device = state_;
    state.entry = of;
    state.program = key;
    guarded(state_->info, "kernels/" + name + ": " + state.entry,
            [&] { state.kernel = cl::Kernel(program, state.entry.c_str()); });
    return kernel;
  };
  if (!device_detail::are_loops_checked(*this)) device_detail::check_loops(*this, make("check_loops"));
  return make(entry);
}

void Device::finish() const {
  guarded(state_->info, "waiting for kernels", [&] { state_->queue.finish(); });
}

Device::MemoryUse Device::memory_use() const { return {state_->memory, state_->memory_peak}; }

void Device::set_memory_limit(std::uint64_t bytes) const { state_->memory_limit = bytes; }

// --- Kernel

void Kernel::run_arguments(std::size_t global, std::size_t local,
                           std::span<const device_detail::Argument> arguments) const {
  RBVH_CHECK(state_ != nullptr && local > 0);
  if (global == 0) return;
  KernelState& state = *state_;
  DeviceState& device = *state.device;
  const std::string launch = state.program + " " + state.entry + " " + std::to_string(local);
  BoundsRecord bounds;
  const auto enqueue = [&](cl::Event* event) {
    const std::lock_guard lock(state.mutex);
    for (cl_uint i = 0; i < arguments.size(); ++i) {
      const device_detail::Argument& argument = arguments[i];
      if (argument.size > 0) {
        state.kernel.setArg(i, argument.size, argument.data);
      } else {
        const auto* buffer = static_cast<const BufferState*>(argument.data);
        const cl_mem memory = buffer != nullptr ? buffer->buffer() : nullptr;
        state.kernel.setArg(i, sizeof memory, &memory);
      }
    }
    if (!bounds.words.empty()) state.kernel.setArg(static_cast<cl_uint>(arguments.size()), bounds.buffer);
    device.queue.enqueueNDRangeKernel(state.kernel, cl::NullRange,
                                      cl::NDRange((global + local - 1) / local * local), cl::NDRange(local),
                                      nullptr, event);
  };
  bool first_launch = false;
  {
    const std::lock_guard lock(device.mutex);
    first_launch = device.launched.insert(launch).second;
  }
  guarded(device.info, "kernels/" + state.program + ": " + state.entry, [&] {
    bounds = make_bounds_record(state, arguments);
    if (first_launch) {
      // PoCL compiles a kernel for a work-group size only when it is first run, between "submitted" and
      // "running".
      device.queue.finish();
      const CompileNotice notice(device.info);
      cl::Event event;
      enqueue(&event);
      device.queue.flush();
      while (event.getInfo<CL_EVENT_COMMAND_EXECUTION_STATUS>() > CL_RUNNING) {
        std::this_thread::sleep_for(std::chrono::microseconds(200));
      }
    } else {
      enqueue(nullptr);
    }
    throw_if_out_of_bounds(state, bounds);
  });
}

// --- Buffer

namespace {

/// Buffers as large as this are worth whole pages of 2 MB.
constexpr std::size_t kHugeBuffer = std::size_t{4} << 20;

/// On a CPU, large ones in huge pages: a traversal of a large tree misses the TLB at every node otherwise,
/// and a quarter of a short run is page faults.
cl::Buffer make_buffer(const DeviceState& device, std::size_t bytes) {
  if (!device.info.is_cpu || bytes < kHugeBuffer) return {device.context, CL_MEM_READ_WRITE, bytes};
  HugePages pages = allocate_huge_pages(bytes);
  if (pages == nullptr) return {device.context, CL_MEM_READ_WRITE, bytes};
  cl::Buffer buffer(device.context, CL_MEM_READ_WRITE | CL_MEM_USE_HOST_PTR, bytes, pages.get());
  // Commands under way keep a buffer, so its memory leaves with it.
  buffer.setDestructorCallback([](cl_mem, void* memory) { HugePages{memory}; }, pages.get());
  static_cast<void>(pages.release());
  return buffer;
}

}  // namespace

std::shared_ptr<BufferState> Device::allocate(std::size_t bytes) const {
  DeviceState& device = *state_;
  const std::size_t allocated = std::max<std::size_t>(1, bytes);
  const std::string what = "a buffer of " + in_words(bytes);
  const std::uint64_t limit = device.memory_limit;
  if (allocated > device.info.max_buffer_bytes) {
    throw Error(ErrorKind::kBudget, {},
                what + " is more than " + device.info.name + " can hold in one piece (" +
                    in_words(device.info.max_buffer_bytes) + "); take a smaller scan or another device");
  }
  if (limit > 0 && device.memory + allocated > limit) {
    throw Error(ErrorKind::kBudget, {},
                what + " beside " + in_words(device.memory) + " in use is over the memory budget of " +
                    in_words(limit),
                Remedy::kMemoryBudget);
  }
  cl::Buffer buffer = guarded(device.info, what, [&] { return make_buffer(device, allocated); });
  auto state = std::make_shared<BufferState>();
  state->device = state_;
  state->buffer = std::move(buffer);
  state->bytes = bytes;
  state->allocated = allocated;
  const std::uint64_t now = device.memory += allocated;
  for (std::uint64_t peak = device.memory_peak;
       peak < now && !device.memory_peak.compare_exchange_weak(peak, now);) {
  }
  return state;
}

namespace {
/// False where there is nothing to do.
bool check_range(const BufferState* state, std::size_t offset, std::size_t bytes) {
  if (bytes == 0) return false;
  RBVH_CHECK(state != nullptr && offset <= state->bytes && bytes <= state->bytes - offset);
  return true;
}
}  // namespace

void Device::read_bytes(BufferState* state, std::size_t offset, void* to, std::size_t bytes, bool waits) {
  if (!check_range(state, offset, bytes)) return;
  guarded(state->device->info, "reading a buffer of " + in_words(state->bytes),
          [&] { state->device->queue.enqueueReadBuffer(state->buffer, waits, offset, bytes, to); });
}

void Device::write_bytes(BufferState* state, std::size_t offset, const void* from, std::size_t bytes,
                         bool waits) {
  if (!check_range(state, offset, bytes)) return;
  guarded(state->device->info, "writing a buffer of " + in_words(state->bytes),
          [&] { state->device->queue.enqueueWriteBuffer(state->buffer, waits, offset, bytes, from); });
}

void Device::fill_bytes(BufferState* state, std::size_t bytes, unsigned char value) {
  if (!check_range(state, 0, bytes)) return;
  guarded(state->device->info, "filling a buffer of " + in_words(state->bytes),
          [&] { state->device->queue.enqueueFillBuffer(state->buffer, value, 0, bytes); });
}

void Device::copy_bytes(BufferState* to, std::size_t to_offset, BufferState* from, std::size_t from_offset,
                        std::size_t bytes) {
  if (!check_range(to, to_offset, bytes) || !check_range(from, from_offset, bytes)) return;
  guarded(to->device->info, "copying a buffer of " + in_words(bytes), [&] {
    to->device->queue.enqueueCopyBuffer(from->buffer, to->buffer, from_offset, to_offset, bytes);
  });
}

}  // namespace rbvh
