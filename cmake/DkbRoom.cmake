# SPDX-License-Identifier: Apache-2.0
# Compiler settings shared by every target of the project, and the function that declares a room.

add_library(dkb_compile_options INTERFACE)
target_compile_features(dkb_compile_options INTERFACE cxx_std_20)
# -ffp-contract=off: the same source gives the same bits whatever the compiler would like to fuse.
target_compile_options(dkb_compile_options INTERFACE -ffp-contract=off)
# Nobody asks for errno or for traps of the floating-point unit: square roots and roundings are instructions then, and
# loops with branches are vectorised. No bit of a result changes.
target_compile_options(dkb_compile_options INTERFACE "$<BUILD_INTERFACE:-fno-math-errno;-fno-trapping-math>")
if(DKB_SANITIZE)
  # A null pointer that is used is a crash, and what lies beyond an object is AddressSanitizer's: to look for both before
  # each use as well, and for how an address is aligned, takes two fifths of the build's time. The fuzz targets, which
  # read foreign bytes, are built with all of them.
  target_compile_options(dkb_compile_options INTERFACE -fsanitize=${DKB_SANITIZE} -fno-omit-frame-pointer -g1
    $<$<NOT:$<BOOL:${DKB_FUZZ}>>:-fno-sanitize=null,alignment,object-size>
    -fno-sanitize-recover=all)
  target_link_options(dkb_compile_options INTERFACE -fsanitize=${DKB_SANITIZE})
  # Under AddressSanitizer Eigen hands out memory 16 bytes into a block, which only its own functions can free. Ceres,
  # built without it, frees such memory directly where the linker has taken our copy of Eigen's allocation.
  target_compile_definitions(dkb_compile_options INTERFACE EIGEN_MALLOC_ALREADY_ALIGNED=1 DKB_SANITIZED=1)
endif()
if(DKB_FUZZ AND CMAKE_CXX_COMPILER_ID MATCHES Clang)
  target_compile_options(dkb_compile_options INTERFACE -fsanitize=fuzzer-no-link)
endif()
add_library(dkb_warnings INTERFACE)
target_compile_options(dkb_warnings INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual
  # GCC 12 warns falsely on string concatenation (GCC bug 105651), Clang of loops that it does not vectorise as asked.
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict> $<$<CXX_COMPILER_ID:Clang>:-Wno-pass-failed>)
if(DKB_WERROR)
  target_compile_options(dkb_warnings INTERFACE -Werror)
endif()

# dkb_unit_test(PROGRAM LABEL files ...) declares a program of unit tests, which the sanitizers run, and gives LABEL what
# its tests are labelled: `unit`, or `unit.threads` where a file of them or a header beside it has to do with threads, and
# ThreadSanitizer looks at them too.
function(dkb_unit_test program label)
  set_property(GLOBAL APPEND PROPERTY DKB_UNIT_TESTS ${program})
  set(found unit)
  foreach(file ${ARGN})
    string(REGEX REPLACE "(_test)?\\.cpp$" ".h" header ${file})
    foreach(one ${file} ${header})
      if(EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/${one})
        file(STRINGS ${CMAKE_CURRENT_SOURCE_DIR}/${one} threads LIMIT_COUNT 1
          REGEX "#include (<(thread|mutex|atomic|condition_variable)>|\"dkb/util/(bounded_queue|due_stage)\\.h\")")
        if(threads)
          set(found unit.threads)
        endif()
      endif()
    endforeach()
  endforeach()
  if(found STREQUAL unit.threads)
    set_property(GLOBAL APPEND PROPERTY DKB_THREAD_TESTS ${program})
  endif()
  set(${label} ${found} PARENT_SCOPE)
endfunction()

# dkb_add_tests(PROGRAM PREFIX properties ...): each test of a program is one of CTest's. Under a sanitizer the program is,
# since to start it takes longer there than most tests.
function(dkb_add_tests program prefix)
  if(DKB_SANITIZE)
    add_test(NAME ${program} COMMAND ${program})
    set_tests_properties(${program} PROPERTIES TIMEOUT 1200 ${ARGN})
  else()
    gtest_discover_tests(${program} TEST_PREFIX ${prefix}. DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT 600 ${ARGN})
  endif()
endfunction()

# What a program of tests is compiled with: in a Release build they are less optimised than what they test, which takes a
# third less time. No bit of a result changes.
add_library(dkb_test_options INTERFACE)
target_compile_options(dkb_test_options INTERFACE $<$<CONFIG:Release>:-O1>)

# One program of a room's tests; LOOK_AT: files beside theirs that may have to do with threads.
function(dkb_room_tests name suffix)
  cmake_parse_arguments(PROGRAM "" "" "FILES;LOOK_AT;DEPENDS" ${ARGN})
  set(program dkb_${name}${suffix})
  add_executable(${program} ${PROGRAM_FILES})
  dkb_unit_test(${program} label ${PROGRAM_FILES} ${PROGRAM_LOOK_AT})
  target_link_libraries(${program} PRIVATE dkb_${name} dkb_test_options dkb_warnings ${PROGRAM_DEPENDS} GTest::gtest GTest::gtest_main)
  dkb_add_tests(${program} ${name} LABELS ${label})
endfunction()

# dkb_room(NAME [NOT_INSTALLED] SOURCES a.cpp ... TESTS a_test.cpp ... THREAD_TESTS ... DEPENDS lower rooms and libraries
#          PRIVATE_DEPENDS ... TEST_DEPENDS ...)
#
# One folder, one static library dkb_NAME, one test program dkb_NAME_test. A room names only rooms below it. The
# executable and the tests link rooms; users link their objects as one library (Library.cmake), of which a room that is
# NOT_INSTALLED is no part. Where only the THREAD_TESTS have to do with the room's threads, they are a program of their
# own, and ThreadSanitizer, which makes a test twenty times slower, leaves out the others.
function(dkb_room name)
  cmake_parse_arguments(ROOM "NOT_INSTALLED" "" "SOURCES;TESTS;THREAD_TESTS;DEPENDS;PRIVATE_DEPENDS;TEST_DEPENDS" ${ARGN})
  if(ROOM_SOURCES)
    add_library(dkb_${name} STATIC ${ROOM_SOURCES})
    set(scope PUBLIC)
    target_link_libraries(dkb_${name} PRIVATE dkb_warnings ${ROOM_PRIVATE_DEPENDS})
    set_target_properties(dkb_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  else()
    add_library(dkb_${name} INTERFACE)
    set(scope INTERFACE)
  endif()
  target_include_directories(dkb_${name} ${scope} ${PROJECT_SOURCE_DIR}/src ${PROJECT_SOURCE_DIR}/include)
  target_link_libraries(dkb_${name} ${scope} dkb_compile_options ${ROOM_DEPENDS})
  if(NOT ROOM_NOT_INSTALLED)
    set_property(GLOBAL APPEND PROPERTY DKB_ROOMS dkb_${name})
  endif()
  if(BUILD_TESTING AND ROOM_THREAD_TESTS)
    dkb_room_tests(${name} _threads_test FILES ${ROOM_THREAD_TESTS} LOOK_AT ${ROOM_SOURCES} DEPENDS ${ROOM_TEST_DEPENDS})
    dkb_room_tests(${name} _test FILES ${ROOM_TESTS} DEPENDS ${ROOM_TEST_DEPENDS})
  elseif(BUILD_TESTING AND ROOM_TESTS)
    dkb_room_tests(${name} _test FILES ${ROOM_TESTS} LOOK_AT ${ROOM_SOURCES} DEPENDS ${ROOM_TEST_DEPENDS})
  endif()
endfunction()
