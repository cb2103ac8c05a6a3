// What is thrown for bad input, a bad device or a bad environment: by whatever function finds it.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

#pragma GCC visibility push(default)
namespace rbvh {

/// What kind of thing went wrong, for callers that react to it.
enum class ErrorKind {
  kFailure,  ///< an output that cannot be written, a full disk
  kUsage,    ///< something was asked for that makes no sense for this input
  kInput,    ///< an input is missing, cut, malformed or unsupported
  kBudget,   ///< over a memory or error budget
  kDevice,   ///< no usable OpenCL device
};

/// What would help, where that is a setting: callers name it in their own words.
enum class Remedy {
  kNone,               ///< nothing, or the message says it
  kOverwrite,          ///< allow the output to be replaced
  kMemoryBudget,       ///< allow more memory
  kViewUp,             ///< another direction for what is up in the picture
  kPatchCount,         ///< allow more patches, or leave small components out
  kDisplacementScale,  ///< check the displacement map's scale and midlevel
  kDisplacementZero,   ///< say which value of the displacement map means none
  kPatchSide,          ///< allow fewer texels a side of a patch
  kImportProxy,        ///< import the displacement map with its own conventions
  kScanUnits,          ///< state the error in the scan's units, or the scan's units at ingest
  kMeasure,            ///< measure the levels, at the build or against the scan
  kNewLayer,           ///< a layer's resolution is set when it is made
};

/// Where in the file: "line" 12. Lines and elements are numbered as the message's readers number them, bytes
/// from 0.
struct FilePlace {
  std::string_view unit;  ///< "byte", "line" or an element such as "face"; static; empty: nowhere known
  std::uint64_t number = 0;
};

/// what() is one line: file, place, what is wrong, what to do. Whoever prints it puts the stage in front and
/// the remedy's words behind.
class Error : public std::runtime_error {
 public:
  /// `file` may be empty.
  Error(ErrorKind kind, const std::string& file, const std::string& message, Remedy remedy = Remedy::kNone)
      : Error(kind, file, FilePlace{}, message, remedy) {}
  Error(ErrorKind kind, const std::string& file, FilePlace place, const std::string& message,
        Remedy remedy = Remedy::kNone);
  ErrorKind kind() const { return kind_; }
  Remedy remedy() const { return remedy_; }
  FilePlace place() const { return place_; }
  const std::string& file() const { return file_; }
  const std::string& message() const { return message_; }  ///< without file and place

 private:
  ErrorKind kind_;
  Remedy remedy_;
  FilePlace place_;
  std::string file_, message_;
};

}  // namespace rbvh
#pragma GCC visibility pop
