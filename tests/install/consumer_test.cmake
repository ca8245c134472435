# SPDX-License-Identifier: Apache-2.0
# Installs the build to a prefix of its own, builds the program beside this file against it and runs it.
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result)
  if(NOT result EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "failed (${result}): ${command}")
  endif()
endfunction()

file(REMOVE_RECURSE ${WORK_DIR})
run(${CMAKE_COMMAND} --install ${BUILD_DIR} --prefix ${WORK_DIR}/installed --config ${CONFIG})

# What the project demands of its own code must not reach its users, and the package must survive being moved.
file(GLOB_RECURSE package_files ${WORK_DIR}/installed/*/dkb_slam*.cmake)
foreach(file ${package_files})
  file(READ ${file} text)
  if(text MATCHES "-Werror|-Wall")
    message(FATAL_ERROR "${file} carries the project's own warning flags")
  endif()
  string(FIND "${text}" "${WORK_DIR}" position)
  if(NOT position EQUAL -1)
    message(FATAL_ERROR "${file} names the folder it was installed to")
  endif()
endforeach()
file(RENAME ${WORK_DIR}/installed ${WORK_DIR}/moved)

# Every installed header compiles outside the project.
file(GLOB_RECURSE headers RELATIVE ${WORK_DIR}/moved/include ${WORK_DIR}/moved/include/*.h)
list(TRANSFORM headers REPLACE "(.+)" "#include <\\1>\n")
list(JOIN headers "" includes)
file(WRITE ${WORK_DIR}/all_headers.cpp "${includes}")

run(${CMAKE_COMMAND} -S ${CONSUMER_DIR} -B ${WORK_DIR}/consumer -G ${GENERATOR} -D CMAKE_BUILD_TYPE=${CONFIG}
  -D CMAKE_CXX_COMPILER=${CXX_COMPILER} -D CMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER}
  -D CMAKE_PREFIX_PATH=${WORK_DIR}/moved -D ALL_HEADERS=${WORK_DIR}/all_headers.cpp)
run(${CMAKE_COMMAND} --build ${WORK_DIR}/consumer --config ${CONFIG})
run(${WORK_DIR}/consumer/consumer)
