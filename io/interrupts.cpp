// The names of unfinished files are in fixed storage, because the signal handler that removes them may
// neither allocate nor lock.
#include "io/interrupts.h"

#include <limits.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdlib>
#include <mutex>

#include "pipeline/base/error.h"

namespace rbvh {
namespace {

struct Slot {
  bool used;
  char path[PATH_MAX];
};
std::array<Slot, 64> g_unfinished;  // far more than any stage has open at once
std::mutex g_mutex;                 // orders the threads that change g_unfinished
std::atomic<int> g_critical{0};     // threads between two states that the handler must not see
std::atomic<bool> g_exiting{false};
thread_local int t_held = 0;  // HoldInterrupts of this thread
static_assert(std::atomic<int>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);

sigset_t interrupt_signals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&set, signal);
  return set;
}

void remove_unfinished() {
  g_exiting = true;
  while (g_critical > 0) poll(nullptr, 0, 1);
  for (const Slot& slot : g_unfinished)
    if (slot.used) unlink(slot.path);
}

extern "C" void remove_unfinished_and_exit(int) {
  remove_unfinished();
  _exit(128 + SIGINT);  // as shells have it
}

}  // namespace

HoldInterrupts::HoldInterrupts() {
  const sigset_t set = interrupt_signals();
  pthread_sigmask(SIG_BLOCK, &set, &old_);
  g_critical.fetch_add(1);
  if (g_exiting && t_held == 0) {  // another thread is in the handler: create and rename nothing more
    g_critical.fetch_sub(1);
    stop_where_exiting();
  }
  ++t_held;
}

HoldInterrupts::~HoldInterrupts() {
  --t_held;
  g_critical.fetch_sub(1);
  pthread_sigmask(SIG_SETMASK, &old_, nullptr);
}

void add_unfinished(const std::string& path) {
  RBVH_CHECK(path.size() < PATH_MAX);
  const std::lock_guard lock(g_mutex);
  for (Slot& slot : g_unfinished)
    if (!slot.used) {
      path.copy(slot.path, path.size());
      slot.path[path.size()] = '\0';
      slot.used = true;
      return;
    }
  RBVH_CHECK(false && "more unfinished outputs at once than there are slots");
}

void drop_unfinished(const std::string& path) {
  const std::lock_guard lock(g_mutex);
  for (Slot& slot : g_unfinished)
    if (slot.used && path == slot.path) slot.used = false;
}

void stop_where_exiting() {
  while (g_exiting && t_held == 0) pause();
}

void install_interrupt_cleanup() {
  struct sigaction action {};
  action.sa_handler = remove_unfinished_and_exit;
  sigfillset(&action.sa_mask);
  // SIGINT and SIGTERM even where they were ignored (a script's background job): one that
  // arrives was sent on purpose.
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  struct sigaction hangup {};
  sigaction(SIGHUP, nullptr, &hangup);
  if (hangup.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);  // nohup stays nohup
  struct sigaction ignore {};
  ignore.sa_handler = SIG_IGN;
  sigaction(SIGPIPE, &ignore, nullptr);
  sigaction(SIGXFSZ, &ignore, nullptr);
  // A library that calls exit(), as LLVM does where it cannot write.
  std::atexit([] {
    if (t_held == 0) remove_unfinished();
  });
}

}  // namespace rbvh
