// The folder NAME.parts-KEY beside the output NAME.rbvh, in which a build in chunks keeps its parts and,
// until it is done, the files of its cells.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace rbvh {

struct ChunkFolder {
  std::string path, name;     ///< name: without the folders that it lies in
  std::shared_ptr<int> lock;  ///< held while another run must not work in it
};

/// "0007.rbvh".
std::string part_name(std::size_t number);

/// Makes it where it is not there. Throws Error(kFailure), also where another run is working in it.
ChunkFolder open_chunk_folder(const std::string& output, std::uint64_t key);

/// Removes what an earlier run left there, but for parts: a table may name them, and they become the same
/// again.
void empty_folder(const ChunkFolder& folder);

/// The same, and removes the folder where it has no parts.
void discard_folder(ChunkFolder& folder);

/// Throws Error(kFailure) where the disk has no room for so many bytes.
void check_room(const ChunkFolder& folder, std::uint64_t bytes, const std::string& file);

/// Once the output names its parts: removes what is neither a part nor the journal, and such folders of
/// `output` that other builds left, unless another run works in them.
void finish_folder(ChunkFolder& folder, const std::string& output);

}  // namespace rbvh
