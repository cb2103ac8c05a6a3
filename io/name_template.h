// Output names with fields: "{name}-{level}-{frame:03}.png".
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace rbvh {

/// {name}: the input's name without folders and extension; {level}: "Q0" or "exact"; {frame}: the camera's
/// number from 0; {frame:03}: the same with at least 3 digits.
class NameTemplate {
 public:
  NameTemplate() = default;
  /// Throws Error(kUsage) for an unknown field or a lone brace.
  explicit NameTemplate(std::string_view text);

  const std::string& text() const { return text_; }
  bool has(std::string_view field) const;
  std::string fill(std::string_view name, std::string_view level, int frame) const;

 private:
  struct Piece {
    std::string literal;  ///< before the field
    std::string field;    ///< empty: none
    int digits = 0;
  };
  std::string text_;
  std::vector<Piece> pieces_;
};

/// Throws Error(kUsage) where several files, levels or cameras would go to one picture.
void check_names_differ(const NameTemplate& names, const std::vector<std::string>& files, bool several_levels,
                        bool several_cameras);

/// Throws the Error(kUsage) of a file whose picture has another file's name.
[[noreturn]] void refuse_same_name(const std::string& file);

}  // namespace rbvh
