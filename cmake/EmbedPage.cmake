# Writes OUT: the text of PAGE, as raw strings cut to stay under compilers' literal limit.
file(READ ${PAGE} text)
string(LENGTH "${text}" length)
set(pieces "")
set(at 0)
while(at LESS length)
  string(SUBSTRING "${text}" ${at} 8000 piece)
  string(APPEND pieces "    R\"PAGE(${piece})PAGE\"\n")
  math(EXPR at "${at} + 8000")
endwhile()
file(WRITE ${OUT}
  "// Generated from web/viewer.html.\n#include \"io/view_page.h\"\nnamespace rbvh {\n"
  "const char* const kViewerPage =\n${pieces};\n}  // namespace rbvh\n")
