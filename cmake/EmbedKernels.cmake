# Writes OUT: a table of every kernel file's path, as its includers name it without "kernels/", and its text; ROOT is the
# repository, as raw strings cut to stay under compilers' literal limit.
set(rows "")
foreach(file IN LISTS FILES)
  file(RELATIVE_PATH name ${ROOT} ${file})
  string(REGEX REPLACE "^(kernels|include)/" "" name ${name})
  file(READ ${file} text)
  string(LENGTH "${text}" length)
  set(pieces "\"\"")
  set(at 0)
  while(at LESS length)
    string(SUBSTRING "${text}" ${at} 8000 piece)
    string(APPEND pieces " R\"CLSOURCE(${piece})CLSOURCE\"")
    math(EXPR at "${at} + 8000")
  endwhile()
  string(APPEND rows "    {\"${name}\", ${pieces}},\n")
endforeach()
file(WRITE ${OUT}
  "// Generated from kernels/.\n#include \"pipeline/device/embedded_kernels.h\"\nnamespace rbvh {\n"
  "const EmbeddedKernel kEmbeddedKernels[] = {\n${rows}};\n"
  "const std::size_t kEmbeddedKernelCount = sizeof(kEmbeddedKernels) / sizeof(kEmbeddedKernels[0]);\n"
  "}  // namespace rbvh\n")
