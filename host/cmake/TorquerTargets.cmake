# How targets are defined here, so that every one carries the same rules.

# Everything in bin/ that a person runs: tests hold all of it to the same command line.
add_custom_target(torquer_programs)

# Everything that "cmake --install" needs, without the tests.
add_custom_target(torquer_installed)

# Headers that most sources include take a quarter of the time that a source takes to compile, so
# they are compiled once: one set for the programs, one with Catch2 for the tests. A source includes
# what it uses all the same; clang-tidy, which reads it without these headers, sees to that. With a
# compiler launcher they are left out: ccache serves a source only when it sees all of its text.
set(TORQUER_PRECOMPILE ON)
if(CMAKE_CXX_COMPILER_LAUNCHER)
  set(TORQUER_PRECOMPILE OFF)
endif()
set(torquer_common_headers
  <Eigen/Core> <Eigen/Geometry> <algorithm> <array> <chrono> <cmath> <cstdint> <filesystem> <fstream>
  <functional> <map> <memory> <numbers> <optional> <random> <span> <sstream> <string> <thread> <vector>)

# torquer_precompiled(NAME LINK x.. HEADERS <a>..): a set of precompiled headers.
function(torquer_precompiled name)
  cmake_parse_arguments(ARG "" "" "LINK;HEADERS" ${ARGN})
  set(source ${CMAKE_CURRENT_BINARY_DIR}/${name}.cpp)
  file(CONFIGURE OUTPUT ${source} CONTENT "// Compiled because a target must have a source.\n")
  add_library(${name} OBJECT ${source})
  target_link_libraries(${name} PRIVATE torquer_build_rules Eigen3::Eigen ${ARG_LINK})
  target_precompile_headers(${name} PRIVATE ${ARG_HEADERS})
endfunction()

if(TORQUER_PRECOMPILE)
  # Some libraries ask for -pthread; precompiled headers serve only sources that agree. With them GCC
  # 12 takes what is inlined from system headers for ours, where it raises these warnings falsely.
  target_compile_options(torquer_build_rules INTERFACE -pthread
    $<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds;-Wno-stringop-overflow;-Wno-stringop-overread>)
  torquer_precompiled(torquer_precompiled_headers HEADERS ${torquer_common_headers})
endif()

# torquer_library(NAME SOURCES a.cpp.. LINK x..): a static library of this project.
function(torquer_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  target_link_libraries(${name} PUBLIC torquer_build_rules ${ARG_LINK})
  if(TORQUER_PRECOMPILE)
    target_precompile_headers(${name} REUSE_FROM torquer_precompiled_headers)
  endif()
endfunction()

# torquer_manual_page(NAME COMPONENT c COMMAND word.. [DEPENDS target..]): installs its manual page,
# made of what COMMAND prints for --help.
function(torquer_manual_page name)
  cmake_parse_arguments(ARG "" "COMPONENT" "COMMAND;DEPENDS" ${ARGN})
  set(page ${PROJECT_BINARY_DIR}/share/man/man1/${name}.1.gz)
  set(maker ${PROJECT_SOURCE_DIR}/host/packaging/manual_page)
  add_custom_command(OUTPUT ${page}
    COMMAND ${CMAKE_COMMAND} -E make_directory ${PROJECT_BINARY_DIR}/share/man/man1
    COMMAND ${maker} ${name} ${page} ${ARG_COMMAND}
    DEPENDS ${maker} ${ARG_DEPENDS} COMMENT "Manual page of ${name}" VERBATIM)
  add_custom_target(${name}_manual_page ALL DEPENDS ${page})
  add_dependencies(torquer_installed ${name}_manual_page)
  install(FILES ${page} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT ${ARG_COMPONENT})
endfunction()

# torquer_completion(NAME COMPONENT c COMMAND word.. [DEPENDS target..]): installs what bash completes
# its command line by, which COMMAND prints for --completion bash.
function(torquer_completion name)
  cmake_parse_arguments(ARG "" "COMPONENT" "COMMAND;DEPENDS" ${ARGN})
  set(completion ${PROJECT_BINARY_DIR}/share/bash-completion/completions/${name})
  add_custom_command(OUTPUT ${completion}
    COMMAND ${CMAKE_COMMAND} -E make_directory ${PROJECT_BINARY_DIR}/share/bash-completion/completions
    COMMAND ${ARG_COMMAND} --completion bash > ${completion}.part
    COMMAND ${CMAKE_COMMAND} -E rename ${completion}.part ${completion}
    DEPENDS ${ARG_DEPENDS} COMMENT "Completion of ${name}" VERBATIM)
  add_custom_target(${name}_completion ALL DEPENDS ${completion})
  add_dependencies(torquer_installed ${name}_completion)
  install(FILES ${completion} COMPONENT ${ARG_COMPONENT}
    DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
endfunction()

# torquer_program(NAME SOURCES main.cpp.. LINK x..): a program in bin/, with the command line of
# host/support/program.h.
function(torquer_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE torquer_build_rules ${ARG_LINK} torquer_support)
  if(TORQUER_PRECOMPILE)
    target_precompile_headers(${name} REUSE_FROM torquer_precompiled_headers)
  endif()
  add_dependencies(torquer_programs ${name})
  # What has another name, or sanitizers, is for those who work on this tree.
  if(TORQUER_SANITIZE OR NOT name MATCHES "^torquer-")
    return()
  endif()
  install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT programs)
  torquer_manual_page(${name} COMPONENT programs COMMAND $<TARGET_FILE:${name}>
    DEPENDS ${name})
  torquer_completion(${name} COMPONENT programs COMMAND $<TARGET_FILE:${name}> DEPENDS ${name})
  add_dependencies(torquer_installed ${name})
endfunction()

# torquer_benchmark(NAME SOURCES main.cpp.. LINK x.. [DEPENDS target..]): a program in bin/ that
# measures. Builds with sanitizers, where figures mean nothing, leave it out.
function(torquer_benchmark name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK;DEPENDS" ${ARGN})
  if(TORQUER_SANITIZE)
    return()
  endif()
  torquer_program(${name} SOURCES ${ARG_SOURCES} LINK ${ARG_LINK})
  if(ARG_DEPENDS)
    add_dependencies(${name} ${ARG_DEPENDS})
  endif()
endfunction()

# torquer_helper(NAME SOURCES main.cpp.. LINK x..): a program in bin/helpers/ that only tests and
# other programs run.
function(torquer_helper name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE torquer_build_rules ${ARG_LINK})
  set_target_properties(${name} PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY ${CMAKE_RUNTIME_OUTPUT_DIRECTORY}/helpers)
  if(TORQUER_PRECOMPILE)
    target_precompile_headers(${name} REUSE_FROM torquer_precompiled_headers)
  endif()
endfunction()

# Tests call optimized code, and need not be it: a quarter less to compile. The sources of a test
# program are compiled in batches, since most of the time goes into what they all include: nearly
# half less. So names must differ within a test program, unnamed namespaces or not.
add_library(torquer_test_options INTERFACE)
target_compile_options(torquer_test_options INTERFACE $<$<CONFIG:Release>:-O1>
  # GCC takes a source in a batch for a header.
  $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
if(TORQUER_SANITIZE MATCHES "undefined")
  # A quarter less to compile in what tests consist of; the code under test has these checks. Null and
  # stray pointers end a test by AddressSanitizer.
  target_compile_options(torquer_test_options INTERFACE
    -fno-sanitize=null,alignment,pointer-overflow)
endif()

# torquer_test(NAME LABEL l SOURCES a_test.cpp.. LINK x.. [TIMEOUT s] [THREADED] [SERIAL]):
# a Catch2 program whose cases become CTest tests with that label. THREADED: its code has threads,
# so the tsan build holds it too (target torquer_threaded_tests); that build leaves out the others.
# SERIAL: each case has the machine to itself.
function(torquer_test name)
  cmake_parse_arguments(ARG "THREADED;SERIAL" "LABEL;TIMEOUT" "SOURCES;LINK" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  # One CTest run can hold the tests of several builds; the prefix tells them apart.
  set(prefix "${name}: ")
  if(TORQUER_SANITIZE)
    string(REPLACE "," "+" sanitizers ${TORQUER_SANITIZE})
    set(prefix "${name} (${sanitizers}): ")
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE torquer_build_rules torquer_test_support
    Catch2::Catch2WithMain torquer_test_options ${ARG_LINK})
  set_target_properties(${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 12)
  if(TORQUER_PRECOMPILE)
    target_precompile_headers(${name} REUSE_FROM torquer_precompiled_test_headers)
  endif()
  if(TORQUER_SANITIZE STREQUAL "thread" AND NOT ARG_THREADED)
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ON)
    return()
  endif()
  if(TORQUER_SANITIZE STREQUAL "thread")
    target_sources(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests/support/tsan_suppressions.cpp)
  endif()
  catch_discover_tests(${name}
    TEST_PREFIX ${prefix}
    PROPERTIES LABELS ${ARG_LABEL} TIMEOUT ${ARG_TIMEOUT} RUN_SERIAL ${ARG_SERIAL})
  if(ARG_THREADED)
    add_dependencies(torquer_threaded_tests ${name})
  endif()
endfunction()
