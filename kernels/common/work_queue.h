// Groups of GROUP work-items that take jobs until none is left.
#ifndef RBVH_WORK_QUEUE_H
#define RBVH_WORK_QUEUE_H

// Runs `...` with `at` as the number of a job below `count`. A CPU's groups are single work-items that take
// numbers from `queue`, 0 at first. On a GPU there are as many groups as jobs, and the device's own scheduler
// is the queue: PoCL loses jobs of groups that meet at barriers to take the next one together.
#if GROUP > 1
#define GROUP_BARRIER barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE)
#define TAKE_FROM_QUEUE(queue, count, ...) \
  {                                        \
    const uint at = (uint)get_group_id(0); \
    __VA_ARGS__;                           \
  }
#else
#define GROUP_BARRIER
#define TAKE_FROM_QUEUE(queue, count, ...)                                  \
  for (uint at = atomic_inc(queue); at < (count); at = atomic_inc(queue)) { \
    __VA_ARGS__;                                                            \
  }
#endif
#endif
