# SPDX-License-Identifier: Apache-2.0
# Makes index.html, app.js and app.css in OUT from WEB. Packages are fetched into WORK. Without NODE and NPM, or when they
# fail and REQUIRED is not ON, the plain page takes their place.
file(MAKE_DIRECTORY ${OUT} ${WORK})

function(plain_page)
  foreach(name index.html app.js app.css)
    configure_file(${WEB}/plain/${name} ${OUT}/${name} COPYONLY)
    file(TOUCH ${OUT}/${name})
  endforeach()
endfunction()

if(NOT NODE)
  plain_page()
  return()
endif()

foreach(name package.json package-lock.json)
  configure_file(${WEB}/${name} ${WORK}/${name} COPYONLY)
endforeach()
file(SHA256 ${WORK}/package-lock.json lock)
set(fetched "")
if(EXISTS ${WORK}/fetched)
  file(READ ${WORK}/fetched fetched)
endif()
set(result 0)
if(NOT fetched STREQUAL lock)
  execute_process(COMMAND ${NPM} ci --ignore-scripts --omit=dev --no-audit --no-fund --loglevel=error --fetch-retries=2 --fetch-retry-mintimeout=1000 --fetch-retry-maxtimeout=5000 --fetch-timeout=60000
    WORKING_DIRECTORY ${WORK} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output TIMEOUT 300)
  if(result EQUAL 0)
    file(WRITE ${WORK}/fetched ${lock})
  endif()
endif()
if(result EQUAL 0)
  file(REMOVE_RECURSE ${WORK}/src)
  file(COPY ${WEB}/src DESTINATION ${WORK})
  execute_process(
    COMMAND ${NODE} node_modules/esbuild/bin/esbuild src/app.ts --bundle --minify --format=iife --target=es2021
      --legal-comments=inline --log-level=warning --outfile=${OUT}/app.js
    WORKING_DIRECTORY ${WORK} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
endif()
if(result EQUAL 0)
  configure_file(${WEB}/src/index.html ${OUT}/index.html COPYONLY)
  file(TOUCH ${OUT}/index.html)
elseif(REQUIRED STREQUAL "ON")
  message(FATAL_ERROR "DKB_PAGE=ON: the page cannot be bundled (${result}): ${output}")
else()
  message(WARNING "the page cannot be bundled, a plain one takes its place (${result}): ${output}\n"
    "Fetching needs the network: with it, remove ${OUT} and build again; -D DKB_PAGE=OFF does not try")
  plain_page()
endif()
