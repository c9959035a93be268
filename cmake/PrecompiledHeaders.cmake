# SPDX-License-Identifier: Apache-2.0
# Headers that nearly every file reads, compiled once: a third of a cold build. Files include what they
# use all the same: clang-tidy and the fuzz targets (clang) compile without.

option(RAYSTAGE_PRECOMPILED_HEADERS "Compile the headers that nearly every file reads once (GCC)" ON)
if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  set(RAYSTAGE_PRECOMPILED_HEADERS OFF)
endif()

set(common_headers <algorithm> <array> <chrono> <cmath> <cstdint> <filesystem> <functional> <limits> <map>
    <memory> <optional> <set> <span> <string> <string_view> <utility> <vector> <Eigen/Core> <Eigen/Geometry>
    <fmt/format.h>)

# raystage_header_host(NAME HEADERS ... OPTIONS ... LINKS ...)
#   The target that owns one set; who reuses it must compile with the same options. An executable, as the
#   tests are, differs from a library in how its code is placed.
function(raystage_header_host NAME KIND)
  cmake_parse_arguments(ARG "" "" "HEADERS;OPTIONS;LINKS" ${ARGN})
  file(CONFIGURE OUTPUT "${CMAKE_BINARY_DIR}/${NAME}.cpp" CONTENT "int main() {}\n")
  if(KIND STREQUAL "executable")
    add_executable(${NAME} "${CMAKE_BINARY_DIR}/${NAME}.cpp")
  else()
    add_library(${NAME} STATIC "${CMAKE_BINARY_DIR}/${NAME}.cpp")
  endif()
  target_link_libraries(${NAME} PRIVATE raystage_compiler ${ARG_LINKS})
  target_compile_options(${NAME} PRIVATE ${ARG_OPTIONS})
  target_precompile_headers(${NAME} PRIVATE ${ARG_HEADERS})
endfunction()

# raystage_precompiled(TARGET HOST)
function(raystage_precompiled TARGET HOST)
  if(RAYSTAGE_PRECOMPILED_HEADERS)
    target_precompile_headers(${TARGET} REUSE_FROM ${HOST})
    # The same definitions and include folders as those of the headers.
    target_link_libraries(${TARGET} PRIVATE Eigen3::Eigen fmt::fmt)
    if(RAYSTAGE_SANITIZE)
      # Compiled without optimisation, what the headers define is in every object, whether it is used or not.
      target_link_libraries(${TARGET} PRIVATE TBB::tbb)
    endif()
  endif()
endfunction()

if(RAYSTAGE_PRECOMPILED_HEADERS)
  raystage_header_host(raystage_library_headers library
                       HEADERS ${common_headers} <nlohmann/json.hpp> <tbb/parallel_for.h>
                               <tbb/parallel_pipeline.h>
                       LINKS Eigen3::Eigen fmt::fmt nlohmann_json::nlohmann_json TBB::tbb)
  raystage_header_host(raystage_command_headers executable
                       HEADERS ${common_headers} <nlohmann/json.hpp>
                       OPTIONS ${RAYSTAGE_COMMAND_OPTIMISATION}
                       LINKS Eigen3::Eigen fmt::fmt nlohmann_json::nlohmann_json TBB::tbb)
  if(RAYSTAGE_TESTS)
    raystage_header_host(raystage_test_headers executable
                         HEADERS ${common_headers} <gmock/gmock.h> <gtest/gtest.h>
                         OPTIONS ${RAYSTAGE_TEST_OPTIONS}
                         LINKS Eigen3::Eigen fmt::fmt GTest::gtest GTest::gmock)
  endif()
endif()
