# SPDX-License-Identifier: Apache-2.0
# The page's files, made when the project is built: index.html, app.js and app.css in DKB_PAGE_DIR (DKB_PAGE_FILES, the
# target dkb_page). npm fetches what the lock file names, without running any of it; esbuild bundles it.
set(DKB_PAGE AUTO CACHE STRING "Bundle the live page: AUTO (where node and npm are there and can fetch), ON or OFF")
set_property(CACHE DKB_PAGE PROPERTY STRINGS AUTO ON OFF)
set(web ${PROJECT_SOURCE_DIR}/web)
set(DKB_PAGE_DIR ${PROJECT_BINARY_DIR}/page)
set(DKB_PAGE_FILES ${DKB_PAGE_DIR}/index.html ${DKB_PAGE_DIR}/app.js ${DKB_PAGE_DIR}/app.css)

set(page_tools "")
if(NOT DKB_PAGE STREQUAL "OFF")
  find_program(NODE_PROGRAM NAMES node nodejs)
  find_program(NPM_PROGRAM npm)
  if(NODE_PROGRAM AND NPM_PROGRAM)
    execute_process(COMMAND ${NODE_PROGRAM} --version OUTPUT_VARIABLE node_version OUTPUT_STRIP_TRAILING_WHITESPACE)
    if(node_version MATCHES "^v([0-9]+)" AND CMAKE_MATCH_1 GREATER_EQUAL 18)
      set(page_tools -D NODE=${NODE_PROGRAM} -D NPM=${NPM_PROGRAM})
    endif()
  endif()
  if(NOT page_tools)
    set(why "node 18 or newer and npm are not here; install them (apt-get install nodejs npm) and configure again")
    if(DKB_PAGE STREQUAL "ON")
      message(FATAL_ERROR "DKB_PAGE=ON: ${why}")
    endif()
    message(STATUS "Live page: plain, without the 3-D map: ${why}")
  endif()
endif()

file(GLOB_RECURSE page_sources CONFIGURE_DEPENDS ${web}/src/* ${web}/plain/*)
add_custom_command(OUTPUT ${DKB_PAGE_FILES}
  COMMAND ${CMAKE_COMMAND} -D WEB=${web} -D OUT=${DKB_PAGE_DIR} -D WORK=${PROJECT_BINARY_DIR}/web -D REQUIRED=${DKB_PAGE} ${page_tools}
    -P ${PROJECT_SOURCE_DIR}/cmake/bundle_page.cmake
  DEPENDS ${page_sources} ${web}/package.json ${web}/package-lock.json ${PROJECT_SOURCE_DIR}/cmake/bundle_page.cmake
  COMMENT "Bundling the live page" VERBATIM)
add_custom_target(dkb_page DEPENDS ${DKB_PAGE_FILES})
