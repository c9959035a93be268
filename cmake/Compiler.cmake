# SPDX-License-Identifier: Apache-2.0
# Language level, warnings and sanitizers, as one INTERFACE target that every target of ours links.

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/bin")

if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()

find_program(CCACHE ccache)
if(CCACHE)
  # Inside the checkout, so that a build touches nothing outside of it, unless CCACHE_DIR names a cache that
  # several checkouts share. There CCACHE_BASEDIR and CCACHE_NOHASHDIR make paths relative to the checkout
  # (.ci/run sets all three); sources are preprocessed before they are looked up, because the unity files
  # that CMake writes name theirs by absolute path. Sloppiness is what ccache asks of precompiled headers.
  set(cache_settings CCACHE_SLOPPINESS=pch_defines,time_macros)
  if(NOT DEFINED ENV{CCACHE_DIR})
    # In depend mode a miss costs no preprocessing.
    list(APPEND cache_settings "CCACHE_DIR=${PROJECT_SOURCE_DIR}/build/ccache" CCACHE_DEPEND=1)
  endif()
  set(CMAKE_CXX_COMPILER_LAUNCHER "${CMAKE_COMMAND}" -E env ${cache_settings} "${CCACHE}")
endif()

add_library(raystage_compiler INTERFACE)
target_include_directories(raystage_compiler INTERFACE "${PROJECT_SOURCE_DIR}" "${PROJECT_BINARY_DIR}")
target_compile_options(raystage_compiler INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual -Wcast-qual
  -Wimplicit-fallthrough -Wundef
  # Same bytes on every build: no contraction of a*b+c unless the code asks for it.
  -ffp-contract=off)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  # GCC 12 sees copies that overlap, or overrun, in std::string's operator+ and moves (GCC bugs 105651,
  # 105329); the address sanitizer looks for true ones.
  target_compile_options(raystage_compiler INTERFACE -Wno-restrict -Wno-array-bounds -Wno-stringop-overflow
                         -Wno-stringop-overread)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # Raises GCC's garbage collection threshold to 512 MB: saves a twelfth of the compile time.
  target_compile_options(raystage_compiler INTERFACE --param=ggc-min-heapsize=524288)
  # ccache reads precompiled headers only where preprocessed text names them.
  target_compile_options(raystage_compiler INTERFACE -fpch-preprocess)
endif()
if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  # In a unity build GCC takes included sources for headers and warns about their anonymous namespaces.
  target_compile_options(raystage_compiler INTERFACE -Wno-subobject-linkage)
endif()
if(RAYSTAGE_WARNINGS_AS_ERRORS)
  target_compile_options(raystage_compiler INTERFACE -Werror)
endif()
if(RAYSTAGE_SANITIZE)
  target_compile_options(raystage_compiler INTERFACE
    -fsanitize=${RAYSTAGE_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer -g1)
  target_link_options(raystage_compiler INTERFACE -fsanitize=${RAYSTAGE_SANITIZE})
endif()
