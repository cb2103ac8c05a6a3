# Writes OUT: the text of PAGE.
include(${CMAKE_CURRENT_LIST_DIR}/raw_strings.cmake)
file(READ ${PAGE} text)
to_raw_strings(strings "${text}")
file(WRITE ${OUT}
  "// Generated from web/viewer.html.\n#include \"io/view_page.h\"\nnamespace rbvh {\n"
  "const char* const kViewerPage = ${strings};\n}  // namespace rbvh\n")
