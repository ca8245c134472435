# SPDX-License-Identifier: Apache-2.0
# Imported targets for single OpenCV modules (dkb_opencv_core, ...), found without OpenCVConfig.cmake, because the
# package that carries it drags in every module. dkb_find_opencv(core imgproc ...) sets DKB_OPENCV_FOUND.
function(dkb_find_opencv)
  set(found TRUE)
  find_path(DKB_OPENCV_INCLUDE opencv2/core.hpp PATH_SUFFIXES opencv4)
  foreach(module ${ARGN})
    if(TARGET dkb_opencv_${module})
      continue()
    endif()
    find_library(DKB_OPENCV_${module} opencv_${module})
    if(DKB_OPENCV_INCLUDE AND DKB_OPENCV_${module})
      add_library(dkb_opencv_${module} UNKNOWN IMPORTED GLOBAL)
      set_target_properties(dkb_opencv_${module} PROPERTIES IMPORTED_LOCATION ${DKB_OPENCV_${module}}
        INTERFACE_INCLUDE_DIRECTORIES ${DKB_OPENCV_INCLUDE} INTERFACE_SYSTEM_INCLUDE_DIRECTORIES ${DKB_OPENCV_INCLUDE})
    else()
      set(found FALSE)
    endif()
  endforeach()
  set(DKB_OPENCV_FOUND ${found} PARENT_SCOPE)
endfunction()
