# SPDX-License-Identifier: Apache-2.0
# What users link: the rooms' objects once more, as one shared and one static library. Both are called dkb_slam and show
# include/dkb_slam alone. Before version 1.0 every minor version may change the binary interface, so the SONAME carries
# major and minor: libdkb_slam.so.0.2.
get_property(rooms GLOBAL PROPERTY DKB_ROOMS)
set(objects "")
foreach(room ${rooms})
  list(APPEND objects $<TARGET_OBJECTS:${room}>)
endforeach()
# What the objects need; the package's pkg-config and CMake files name the same.
set(DKB_LINKED fmt::fmt yaml-cpp PNG::PNG ZLIB::ZLIB JPEG::JPEG Threads::Threads ${CMAKE_DL_LIBS})
foreach(name BZ2 LZ4 ZSTD SQLITE3 DEFLATE)
  if(DKB_${name}_INCLUDE AND DKB_${name}_LIBRARY)
    list(APPEND DKB_LINKED $<BUILD_INTERFACE:${DKB_${name}_LIBRARY}>)
  endif()
endforeach()
list(TRANSFORM DKB_CODEC_NAMES REPLACE "(.+)" "$<INSTALL_INTERFACE:\\1>" OUTPUT_VARIABLE installed)
list(APPEND DKB_LINKED ${installed})

add_library(dkb_shared SHARED ${objects})
add_library(dkb_static STATIC ${objects})
foreach(library dkb_shared dkb_static)
  add_dependencies(${library} ${rooms})
  target_compile_features(${library} PUBLIC cxx_std_20)
  target_include_directories(${library} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_link_libraries(${library} PUBLIC Eigen3::Eigen PRIVATE ${DKB_LINKED})
  set_target_properties(${library} PROPERTIES OUTPUT_NAME dkb_slam LINKER_LANGUAGE CXX
    LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/lib ARCHIVE_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/lib)
endforeach()
set_target_properties(dkb_shared PROPERTIES EXPORT_NAME dkb_slam VERSION ${PROJECT_VERSION}
  SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
set_target_properties(dkb_static PROPERTIES EXPORT_NAME static)
if(DKB_SANITIZE)
  target_link_options(dkb_shared PRIVATE -fsanitize=${DKB_SANITIZE})
else()
  target_link_options(dkb_shared PRIVATE LINKER:--no-undefined)
endif()
# The same names when the project is a subdirectory of another.
add_library(dkb_slam::dkb_slam ALIAS dkb_shared)
add_library(dkb_slam::static ALIAS dkb_static)
