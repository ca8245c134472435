# SPDX-License-Identifier: Apache-2.0
# `cmake --install` puts the executable, the rooms' libraries and headers in place, with a package for
# find_package(dkb_slam). Users link dkb_slam::dkb_slam, which brings every room; single rooms are dkb_slam::ROOM.
include(CMakePackageConfigHelpers)

get_property(rooms GLOBAL PROPERTY DKB_ROOMS)
add_library(dkb_all INTERFACE)
target_link_libraries(dkb_all INTERFACE ${rooms})
set_target_properties(dkb_all PROPERTIES EXPORT_NAME dkb_slam)
set_target_properties(dkb_compile_options PROPERTIES EXPORT_NAME compile_options)
add_library(dkb_slam::dkb_slam ALIAS dkb_all)  # the same name when the project is a subdirectory of another

# The package asks for what the rooms link, and for nothing else.
set(linked "")
foreach(room ${rooms})
  foreach(property LINK_LIBRARIES INTERFACE_LINK_LIBRARIES)
    get_target_property(libraries ${room} ${property})
    if(libraries)
      list(APPEND linked ${libraries})
    endif()
  endforeach()
endforeach()
set(DKB_FIND_DEPENDENCIES "")
foreach(pair "Threads::Threads=Threads" "Eigen3::Eigen=Eigen3 3.3" "PNG::PNG=PNG" "JPEG::JPEG=JPEG" "yaml-cpp=yaml-cpp"
    "nlohmann_json::nlohmann_json=nlohmann_json" "fmt::fmt=fmt" "nanoflann::nanoflann=nanoflann")
  string(REGEX MATCH "^(.*)=(.*)$" unused ${pair})
  if(CMAKE_MATCH_1 IN_LIST linked)
    string(APPEND DKB_FIND_DEPENDENCIES "find_dependency(${CMAKE_MATCH_2})\n")
  endif()
endforeach()
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/dkb_slam)
set(opencv_modules ${linked})
list(FILTER opencv_modules INCLUDE REGEX "^dkb_opencv_")
if(opencv_modules)
  list(TRANSFORM opencv_modules REPLACE "^dkb_opencv_" "")
  list(REMOVE_DUPLICATES opencv_modules)
  list(JOIN opencv_modules " " opencv_modules)
  string(APPEND DKB_FIND_DEPENDENCIES
    "include(\${CMAKE_CURRENT_LIST_DIR}/OpenCV.cmake)\ndkb_find_opencv(${opencv_modules})\n")
  install(FILES ${CMAKE_CURRENT_LIST_DIR}/OpenCV.cmake DESTINATION ${package_dir})
endif()

install(TARGETS dkb_all dkb_compile_options ${rooms} EXPORT dkb_slamTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT dkb_slamTargets NAMESPACE dkb_slam:: DESTINATION ${package_dir})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/src/dkb DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
  FILES_MATCHING PATTERN "*.h" PATTERN "*.inl" PATTERN "simulator" EXCLUDE PATTERN "*_test*" EXCLUDE PATTERN "test_*" EXCLUDE)
if(TARGET dkb-slam)
  install(TARGETS dkb-slam RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()

configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/dkb_slamConfig.cmake.in ${PROJECT_BINARY_DIR}/dkb_slamConfig.cmake
  INSTALL_DESTINATION ${package_dir} NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/dkb_slamConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/dkb_slamConfig.cmake ${PROJECT_BINARY_DIR}/dkb_slamConfigVersion.cmake
  DESTINATION ${package_dir})
