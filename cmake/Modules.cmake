# SPDX-License-Identifier: Apache-2.0
# One library per folder, its links listed by hand; a test is next to its source.

# Tests are compiled with -O1, which takes two thirds of the time of -O3, and with -O0 under sanitizers,
# which halves it again.
set(RAYSTAGE_TEST_OPTIONS -O1)
if(RAYSTAGE_SANITIZE)
  set(RAYSTAGE_TEST_OPTIONS -O0)
endif()
# Assertions name files as they are in the project: checkouts that share a compiler cache share objects.
list(APPEND RAYSTAGE_TEST_OPTIONS "-fmacro-prefix-map=${PROJECT_SOURCE_DIR}/=")
set(RAYSTAGE_COMMAND_OPTIMISATION -O1)  # they parse options and print results: nothing to gain from more
include(PrecompiledHeaders)

# raystage_library(NAME SOURCES ... [ALONE ...] [PUBLIC ...] [PRIVATE ...])
#   Static library raystage_NAME of the folder it is called in; without sources an INTERFACE library. PUBLIC: the
#   libraries whose headers this folder's headers include; PRIVATE: those that only its sources include.
#   tests/module_graph_test.py checks every include against these lists. Where CMAKE_UNITY_BUILD is on, several sources
#   are compiled at a time, except those after ALONE.
function(raystage_library NAME)
  cmake_parse_arguments(ARG "" "" "SOURCES;ALONE;PUBLIC;PRIVATE" ${ARGN})
  if(ARG_SOURCES OR ARG_ALONE)
    set_source_files_properties(${ARG_ALONE} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    add_library(raystage_${NAME} STATIC ${ARG_SOURCES} ${ARG_ALONE})
    target_link_libraries(raystage_${NAME} PUBLIC raystage_compiler ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
    raystage_precompiled(raystage_${NAME} raystage_library_headers)
  else()
    add_library(raystage_${NAME} INTERFACE)
    target_link_libraries(raystage_${NAME} INTERFACE raystage_compiler ${ARG_PUBLIC})
  endif()
  raystage_record_links(raystage_${NAME} "${ARG_PUBLIC}" "${ARG_PRIVATE}")
endfunction()

# raystage_record_links(TARGET PUBLIC PRIVATE)
#   Adds a target to module_graph.json in the build folder, which tests/module_graph_test.py reads.
function(raystage_record_links TARGET PUBLIC PRIVATE)
  file(RELATIVE_PATH folder "${PROJECT_SOURCE_DIR}" "${CMAKE_CURRENT_SOURCE_DIR}")
  list(JOIN PUBLIC " " public)
  list(JOIN PRIVATE " " private)
  set_property(GLOBAL APPEND PROPERTY RAYSTAGE_MODULES
    "{\"target\": \"${TARGET}\", \"folder\": \"${folder}\", \"public\": \"${public}\", \"private\": \"${private}\"}")
endfunction()

# raystage_write_module_graph()
#   Writes module_graph.json: one object for each library and command.
function(raystage_write_module_graph)
  get_property(targets GLOBAL PROPERTY RAYSTAGE_MODULES)
  list(JOIN targets ",\n " targets)
  file(CONFIGURE OUTPUT "${CMAKE_BINARY_DIR}/module_graph.json" CONTENT "[${targets}]\n" @ONLY)
endfunction()

# raystage_test(NAME SOURCES ... [ALONE ...] LINKS ... [LABELS ...] [LOCK NAME])
#   One GoogleTest executable for a folder's tests; every TEST becomes a ctest of its own. ALONE as above.
#   Tests with the same LOCK run one after the other. LABELS, e.g. `slow`, apply to all tests of the folder.
function(raystage_test NAME)
  if(NOT RAYSTAGE_TESTS)
    return()
  endif()
  cmake_parse_arguments(ARG "" "LOCK" "SOURCES;ALONE;LINKS;LABELS" ${ARGN})
  set(lock)
  if(ARG_LOCK)
    set(lock RESOURCE_LOCK ${ARG_LOCK})
  endif()
  set_source_files_properties(${ARG_ALONE} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  add_executable(raystage_${NAME}_test ${ARG_SOURCES} ${ARG_ALONE})
  target_link_libraries(raystage_${NAME}_test PRIVATE raystage_compiler ${ARG_LINKS}
                        raystage_testing GTest::gtest_main GTest::gmock)
  target_compile_options(raystage_${NAME}_test PRIVATE ${RAYSTAGE_TEST_OPTIONS})
  raystage_precompiled(raystage_${NAME}_test raystage_test_headers)
  # CMake 3.25 cannot give discovered tests a list of labels; those of a folder count for all of its tests.
  set_property(DIRECTORY APPEND PROPERTY LABELS ${ARG_LABELS})
  gtest_discover_tests(raystage_${NAME}_test DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60
    PROPERTIES LABELS "${NAME}" TIMEOUT 600 ${lock})  # a busy machine is no fault
endfunction()
include(GoogleTest)

# raystage_command(NAME SOURCES ... LINKS ...)
#   The executable raystage-NAME, which `raystage NAME` runs; installed, and listed in the global property
#   RAYSTAGE_COMMANDS.
function(raystage_command NAME)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINKS" ${ARGN})
  add_executable(raystage-${NAME} ${ARG_SOURCES})
  target_link_libraries(raystage-${NAME} PRIVATE raystage_compiler ${ARG_LINKS})
  target_compile_options(raystage-${NAME} PRIVATE ${RAYSTAGE_COMMAND_OPTIMISATION})
  raystage_precompiled(raystage-${NAME} raystage_command_headers)
  install(TARGETS raystage-${NAME} RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}")
  set_property(GLOBAL APPEND PROPERTY RAYSTAGE_COMMANDS ${NAME})
  raystage_record_links(raystage-${NAME} "" "${ARG_LINKS}")
endfunction()

# raystage_kernels(FILES...)
#   Sources with Highway kernels: the inner loops of every frame. Highway picks AVX2 or AVX-512 at
#   run time; SSE4 is the least that we support on x86 and therefore its baseline.
function(raystage_kernels)
  set(options)
  if(NOT RAYSTAGE_SANITIZE)  # which looks for faults, not for time: instrumented -O3 takes minutes
    set(options -O3)
  endif()
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    list(APPEND options -msse4.2 -mpclmul -maes)
  endif()
  set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS "${options}"
                              SKIP_PRECOMPILE_HEADERS ON  # compiled for another machine
                              SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# raystage_decoder(NAME SOURCES ... LINKS ...): a program of lib/raystage that decodes strangers' files, see sandbox/.
function(raystage_decoder NAME)
  cmake_parse_arguments(DECODER "" "" "SOURCES;LINKS" ${ARGN})
  string(REPLACE "_" "-" program "${NAME}")
  add_executable(raystage_${NAME} ${DECODER_SOURCES})
  set_target_properties(raystage_${NAME} PROPERTIES OUTPUT_NAME "raystage-${program}"
    RUNTIME_OUTPUT_DIRECTORY "${CMAKE_RUNTIME_OUTPUT_DIRECTORY}/${RAYSTAGE_MODULE_DIRECTORY}")
  target_link_libraries(raystage_${NAME} PRIVATE raystage_compiler raystage_decoder_main ${DECODER_LINKS})
  install(TARGETS raystage_${NAME} RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}/${RAYSTAGE_MODULE_DIRECTORY}")
endfunction()

# raystage_loaded_module(NAME OUTPUT SOURCES ... LINKS ...): a module of lib/raystage, OUTPUT.so, that is loaded at run time.
function(raystage_loaded_module NAME OUTPUT)
  cmake_parse_arguments(MODULE "" "" "SOURCES;LINKS" ${ARGN})
  add_library(${NAME} MODULE ${MODULE_SOURCES})
  set_target_properties(${NAME} PROPERTIES PREFIX "" OUTPUT_NAME "${OUTPUT}" NO_SONAME ON
    LIBRARY_OUTPUT_DIRECTORY "${CMAKE_RUNTIME_OUTPUT_DIRECTORY}/${RAYSTAGE_MODULE_DIRECTORY}")
  target_link_libraries(${NAME} PRIVATE raystage_compiler ${MODULE_LINKS})
  install(TARGETS ${NAME} LIBRARY DESTINATION "${CMAKE_INSTALL_BINDIR}/${RAYSTAGE_MODULE_DIRECTORY}")
endfunction()
