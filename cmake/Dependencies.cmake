# SPDX-License-Identifier: Apache-2.0
# All external libraries, under the target names that the folders use.
# The Debian packages that hold them are listed, with what each is for, in scripts/packages.txt.

find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)
find_package(Eigen3 3.4 CONFIG REQUIRED)           # Eigen3::Eigen
find_package(TBB CONFIG REQUIRED)                  # TBB::tbb
find_package(nlohmann_json 3.11 CONFIG REQUIRED)   # nlohmann_json::nlohmann_json
find_package(CLI11 CONFIG REQUIRED)                # CLI11::CLI11
find_package(fmt CONFIG REQUIRED)                  # fmt::fmt
find_package(OpenEXR 3.1 CONFIG REQUIRED)          # OpenEXR::OpenEXR
find_package(OpenImageIO 2.4 CONFIG REQUIRED)      # OpenImageIO::OpenImageIO
# Debian's target names the header folder of OpenCV, which its users need not have.
get_target_property(oiio_includes OpenImageIO::OpenImageIO INTERFACE_INCLUDE_DIRECTORIES)
foreach(folder IN LISTS oiio_includes)
  if(NOT EXISTS "${folder}")
    list(REMOVE_ITEM oiio_includes "${folder}")
  endif()
endforeach()
set_target_properties(OpenImageIO::OpenImageIO PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${oiio_includes}")
pkg_check_modules(OCIO REQUIRED IMPORTED_TARGET OpenColorIO)            # PkgConfig::OCIO
find_package(assimp 5.2 CONFIG REQUIRED)           # assimp::assimp
find_package(embree 3 CONFIG REQUIRED)             # embree
find_package(Ceres 2.1 CONFIG REQUIRED)            # Ceres::ceres
pkg_check_modules(TURBOJPEG REQUIRED IMPORTED_TARGET libturbojpeg libjpeg) # PkgConfig::TURBOJPEG
find_package(OpenSSL 3.0 REQUIRED COMPONENTS Crypto)                        # OpenSSL::Crypto
pkg_check_modules(SECCOMP REQUIRED IMPORTED_TARGET libseccomp)             # PkgConfig::SECCOMP
pkg_check_modules(PNG REQUIRED IMPORTED_TARGET libpng)                      # PkgConfig::PNG
pkg_check_modules(JXL REQUIRED IMPORTED_TARGET libjxl)                      # PkgConfig::JXL
pkg_check_modules(ZSTD REQUIRED IMPORTED_TARGET libzstd)                   # PkgConfig::ZSTD
pkg_check_modules(XXHASH REQUIRED IMPORTED_TARGET libxxhash)               # PkgConfig::XXHASH
pkg_check_modules(LIBDEFLATE REQUIRED IMPORTED_TARGET libdeflate)         # PkgConfig::LIBDEFLATE
pkg_check_modules(HWY REQUIRED IMPORTED_TARGET libhwy)                     # PkgConfig::HWY
pkg_check_modules(FFMPEG REQUIRED IMPORTED_TARGET
                  libavformat libavcodec libavutil libswscale)             # PkgConfig::FFMPEG
pkg_check_modules(ARAVIS REQUIRED IMPORTED_TARGET aravis-0.8)               # PkgConfig::ARAVIS
# Its -pthread means nothing to glibc any more, but a macro apart from what other files are compiled with.
get_target_property(aravis_options PkgConfig::ARAVIS INTERFACE_COMPILE_OPTIONS)
list(REMOVE_ITEM aravis_options -pthread)
set_target_properties(PkgConfig::ARAVIS PROPERTIES INTERFACE_COMPILE_OPTIONS "${aravis_options}")
# Debian keeps OpenCV's CMake and pkg-config files in libopencv-dev, with VTK and Qt behind it: the
# modules wanted are found without them.
find_path(OPENCV_INCLUDE opencv2/core.hpp PATH_SUFFIXES opencv4 REQUIRED)
foreach(module core imgproc video calib3d features2d aruco mcc dnn)   # opencv_core ...
  find_library(OPENCV_${module} opencv_${module} REQUIRED)
  add_library(opencv_${module} INTERFACE IMPORTED)
  target_link_libraries(opencv_${module} INTERFACE "${OPENCV_${module}}")
  target_include_directories(opencv_${module} SYSTEM INTERFACE "${OPENCV_INCLUDE}")
endforeach()
# Loaded at run time only, by the version that its header names.
pkg_check_modules(AVDEVICE REQUIRED libavdevice)
find_package(CURL 7.88 REQUIRED COMPONENTS HTTP HTTPS)    # CURL_INCLUDE_DIRS; libcurl.so.4 is loaded, too
find_package(MPI REQUIRED COMPONENTS C)            # MPI::MPI_C
find_package(Boost 1.74 REQUIRED)                  # Boost::headers
if(RAYSTAGE_TESTS)
  find_package(GTest REQUIRED)                     # GTest::gtest_main
  find_package(rapidcheck REQUIRED)                # rapidcheck
endif()
if(RAYSTAGE_BENCHMARKS)
  find_package(benchmark REQUIRED)                 # benchmark::benchmark
endif()
