# SPDX-License-Identifier: Apache-2.0
# `cmake --install` puts the executable, the public headers and both libraries in place, with a package for
# find_package(dkb_slam CONFIG) and one for pkg-config. Both can be moved as a whole.
include(CMakePackageConfigHelpers)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/dkb_slam)

install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/dkb_slam DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
install(TARGETS dkb-slam RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
install(TARGETS dkb_shared EXPORT dkb_slamTargets LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(TARGETS dkb_static EXPORT dkb_slamStaticTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT dkb_slamTargets NAMESPACE dkb_slam:: DESTINATION ${package_dir})
install(EXPORT dkb_slamStaticTargets NAMESPACE dkb_slam:: DESTINATION ${package_dir})

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/dkb_slamConfig.cmake.in ${PROJECT_BINARY_DIR}/dkb_slamConfig.cmake
  INSTALL_DESTINATION ${package_dir} NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/dkb_slamConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/dkb_slamConfig.cmake ${PROJECT_BINARY_DIR}/dkb_slamConfigVersion.cmake
  DESTINATION ${package_dir})

file(RELATIVE_PATH prefix_from_pc ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig ${CMAKE_INSTALL_PREFIX})
string(REGEX REPLACE "/$" "" prefix_from_pc ${prefix_from_pc})
list(TRANSFORM DKB_CODEC_NAMES PREPEND -l OUTPUT_VARIABLE DKB_CODEC_FLAGS)
string(REPLACE ";" " " DKB_CODEC_FLAGS "${DKB_CODEC_FLAGS}")
configure_file(${CMAKE_CURRENT_LIST_DIR}/dkb_slam.pc.in ${PROJECT_BINARY_DIR}/dkb_slam.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/dkb_slam.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
