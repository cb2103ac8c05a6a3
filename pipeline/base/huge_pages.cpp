#include "pipeline/base/huge_pages.h"

#include <sys/mman.h>

namespace rbvh {

HugePages allocate_huge_pages(std::size_t bytes) {
  constexpr std::size_t kPage = std::size_t{2} << 20;
  const std::size_t whole = (bytes + kPage - 1) / kPage * kPage;
  HugePages pages(std::aligned_alloc(kPage, whole));
  if (pages != nullptr) madvise(pages.get(), whole, MADV_HUGEPAGE);  // a wish: usual pages serve as well
  return pages;
}

}  // namespace rbvh
