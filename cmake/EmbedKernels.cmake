# Writes OUT: a table of every kernel file's path, as its includers name it without "kernels/", and its text; ROOT is the
# repository.
include(${CMAKE_CURRENT_LIST_DIR}/raw_strings.cmake)
set(rows "")
foreach(file IN LISTS FILES)
  file(RELATIVE_PATH name ${ROOT} ${file})
  string(REGEX REPLACE "^(kernels|include)/" "" name ${name})
  file(READ ${file} text)
  to_raw_strings(strings "${text}")
  string(APPEND rows "    {\"${name}\", ${strings}},\n")
endforeach()
file(WRITE ${OUT}
  "// Generated from kernels/.\n#include \"pipeline/device/embedded_kernels.h\"\nnamespace rbvh {\n"
  "const EmbeddedKernel kEmbeddedKernels[] = {\n${rows}};\n"
  "const std::size_t kEmbeddedKernelCount = sizeof(kEmbeddedKernels) / sizeof(kEmbeddedKernels[0]);\n"
  "}  // namespace rbvh\n")
