// What is left beside an output once it is replaced by one of another kind: a pair's atlas, the parts of a
// pair of parts.
#pragma once

#include <string>
#include <vector>

namespace rbvh {

/// The atlas of a pair, where it is the one that the pair names; nothing for other files.
std::vector<std::string> files_of_pair(const std::string& path);

/// The parts of a pair of parts in the folder that was made for it, their journal, and that folder; nothing
/// for other files, and while a build works there.
std::vector<std::string> files_of_parts(const std::string& path);

/// Removes what is there; of folders those that are empty.
void remove_leftovers(const std::vector<std::string>& paths);

}  // namespace rbvh
