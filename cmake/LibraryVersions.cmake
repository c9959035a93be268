# SPDX-License-Identifier: Apache-2.0
# Sets RAYSTAGE_LIBRARY_VERSIONS to "NAME VERSION, ...": the libraries found, for --version.

# header_version(VARIABLE HEADER REGEX...)
#   Reads a version from a header, for libraries whose CMake or pkg-config files do not state it: the
#   first group of each REGEX, joined by dots.
function(header_version VARIABLE HEADER)
  file(READ "${HEADER}" text)
  set(parts)
  foreach(regex IN LISTS ARGN)
    if(text MATCHES "${regex}")
      list(APPEND parts "${CMAKE_MATCH_1}")
    endif()
  endforeach()
  list(JOIN parts "." version)
  set(${VARIABLE} "${version}" PARENT_SCOPE)
endfunction()

find_path(FFMPEG_VERSION_INCLUDE libavutil/ffversion.h HINTS ${FFMPEG_INCLUDE_DIRS} REQUIRED)
header_version(ffmpeg "${FFMPEG_VERSION_INCLUDE}/libavutil/ffversion.h" "FFMPEG_VERSION \"([^\"]+)\"")
header_version(opencv "${OPENCV_INCLUDE}/opencv2/core/version.hpp" "CV_VERSION_MAJOR +([0-9]+)"
               "CV_VERSION_MINOR +([0-9]+)" "CV_VERSION_REVISION +([0-9]+)")
set(versions
  "FFmpeg ${ffmpeg}" "OpenEXR ${OpenEXR_VERSION}" "OpenImageIO ${OpenImageIO_VERSION}"
  "OpenColorIO ${OCIO_VERSION}" "Embree ${embree_VERSION}" "oneTBB ${TBB_VERSION}" "OpenCV ${opencv}"
  "Ceres ${Ceres_VERSION}" "Eigen ${Eigen3_VERSION}" "Assimp ${assimp_VERSION}" "Aravis ${ARAVIS_VERSION}"
  "libcurl ${CURL_VERSION_STRING}"
  "libjpeg-turbo ${TURBOJPEG_libturbojpeg_VERSION}" "libpng ${PNG_VERSION}" "libjxl ${JXL_VERSION}" "zstd ${ZSTD_VERSION}"
  "xxHash ${XXHASH_VERSION}" "Highway ${HWY_VERSION}" "nlohmann-json ${nlohmann_json_VERSION}"
  "CLI11 ${CLI11_VERSION}" "fmt ${fmt_VERSION}")
foreach(entry IN LISTS versions)
  if(NOT entry MATCHES "^[^ ]+ [0-9]")
    message(FATAL_ERROR "The version of ${entry}was not found (cmake/LibraryVersions.cmake)")
  endif()
endforeach()
list(JOIN versions ", " RAYSTAGE_LIBRARY_VERSIONS)
