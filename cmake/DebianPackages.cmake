# Packages for Debian, made by `cpack -G DEB` in the build folder: rbvh (the tool), librbvh0.1, librbvh-dev, python3-rbvh.
# What they need of other packages is found by dpkg-shlibdeps in what they hold, but for what is loaded by name.
set(CPACK_PACKAGE_CONTACT "rbvh authors <rbvh@localhost>")
set(CPACK_PACKAGE_VENDOR "rbvh")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_GENERATOR DEB)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${CMAKE_CURRENT_BINARY_DIR})
set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS ON)
set(CPACK_COMPONENTS_ALL tool library development)
set(CPACK_COMPONENT_TOOL_DESCRIPTION "Scans to rasterized bounding volume hierarchies: the tool
Turns meshes and point clouds into shallow hierarchies of height-field tiles
and triangles that are ray cast directly, and draws them.")
set(CPACK_COMPONENT_LIBRARY_DESCRIPTION "Scans to rasterized bounding volume hierarchies: the library")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "Scans to rasterized bounding volume hierarchies: headers")
set(CPACK_COMPONENT_PYTHON_DESCRIPTION "Scans to rasterized bounding volume hierarchies: the Python module")
set(CPACK_COMPONENT_TOOL_DEPENDS library)
set(CPACK_COMPONENT_DEVELOPMENT_DEPENDS library)
set(CPACK_COMPONENT_PYTHON_DEPENDS library)
set(library_package librbvh${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
set(CPACK_DEBIAN_TOOL_PACKAGE_NAME rbvh)
set(CPACK_DEBIAN_TOOL_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_TOOL_PACKAGE_RECOMMENDS fonts-dejavu-core)  # labels in pictures
set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME ${library_package})
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_DEPENDS "pocl-opencl-icd | opencl-icd")  # something that runs the kernels
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME librbvh-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
# Of the static library, which asks for the development packages of what it links.
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS
  "libpcl-dev, libopenmesh-dev, ocl-icd-opencl-dev, libspdlog-dev, libtinygltf-dev, libmeshoptimizer-dev, libtiff-dev")
if(TARGET rbvh_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-rbvh)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  math(EXPR next_minor "${Python_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3 (>= ${Python_VERSION_MAJOR}.${Python_VERSION_MINOR}), \
python3 (<< ${Python_VERSION_MAJOR}.${next_minor}), python3-numpy")
endif()
include(CPack)
