# Functions that define targets, so that all targets have the same rules.

# All programs in bin/ for users. Tests check that their command lines follow the same rules.
add_custom_target(torquer_programs)

# All targets that "cmake --install" needs, without the tests.
add_custom_target(torquer_installed)

# Precompiled headers save a quarter of the compile time of most sources. There is one set for the programs, and one
# with Catch2 for the tests. A source must still include the headers that it uses; clang-tidy reads it without
# precompiled headers, and checks this. With a compiler launcher there are none, because ccache needs the complete text
# of a source.
set(TORQUER_PRECOMPILE ON)
if(CMAKE_CXX_COMPILER_LAUNCHER)
  set(TORQUER_PRECOMPILE OFF)
endif()
set(torquer_common_headers
  <Eigen/Core> <Eigen/Geometry> <algorithm> <array> <chrono> <cmath> <cstdint> <filesystem> <fstream>
  <functional> <map> <memory> <numbers> <optional> <random> <span> <sstream> <string> <thread> <vector>)

# Sources of a target are compiled in batches, which share their headers. This saves a sixth of the release build. Names
# must therefore differ within a target, those in unnamed namespaces too.
set(CMAKE_UNITY_BUILD ON)
set(CMAKE_UNITY_BUILD_BATCH_SIZE 24)

# torquer_precompiled(NAME [LINK x..] [OPTIONS -f..] HEADERS <a>..): a set of precompiled headers.
function(torquer_precompiled name)
  cmake_parse_arguments(ARG "" "" "LINK;OPTIONS;HEADERS" ${ARGN})
  set(source ${CMAKE_CURRENT_BINARY_DIR}/${name}.cpp)
  file(CONFIGURE OUTPUT ${source} CONTENT "// Compiled because a target must have a source.\n")
  add_library(${name} OBJECT ${source})
  target_link_libraries(${name} PRIVATE torquer_build_rules Eigen3::Eigen ${ARG_LINK})
  target_compile_options(${name} PRIVATE ${ARG_OPTIONS})
  target_precompile_headers(${name} PRIVATE ${ARG_HEADERS})
endfunction()

if(TORQUER_PRECOMPILE)
  # Some libraries require -pthread, and a source must have the options of its precompiled headers. With precompiled
  # headers GCC 12 raises these warnings falsely, for code that is inlined from system headers.
  target_compile_options(torquer_build_rules INTERFACE -pthread
    $<$<CXX_COMPILER_ID:GNU>:-Wno-array-bounds;-Wno-stringop-overflow;-Wno-stringop-overread>)
  if(TORQUER_SANITIZE)
    # GCC collects no garbage below 1 GB: 5 % less to compile. With a compiler launcher the options stay as they are in
    # its cache.
    target_compile_options(torquer_build_rules INTERFACE
      $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=1048576>)
  endif()
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
# made of the --help text of COMMAND.
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

# torquer_completion(NAME COMPONENT c COMMAND word.. [DEPENDS target..]): installs its completion for bash, which
# COMMAND prints for --completion bash.
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
  # Programs with another name, or with sanitizers, are for developers of this tree and are not
  # installed.
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
# measures. Builds with sanitizers omit it, because their times have no meaning.
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

# Tests call optimized code, but need no optimization themselves. This saves a quarter of their compile time.
add_library(torquer_test_options INTERFACE)
target_compile_options(torquer_test_options INTERFACE $<$<CONFIG:Release>:-O1>)
if(TORQUER_SANITIZE MATCHES "undefined")
  # Test sources omit these checks, which saves a quarter of their compile time. The code under test has them.
  # AddressSanitizer ends a test for null and stray pointers.
  target_compile_options(torquer_test_options INTERFACE
    -fno-sanitize=null,alignment,pointer-overflow)
endif()

# Notes the processor time of a test's command.
set(TORQUER_MEASURED ${PROJECT_SOURCE_DIR}/tests/measured)
# Test programs to which sanitizers add a check. The others run under sanitizers only with --soak.
add_custom_target(torquer_sanitizer_tests)

# torquer_test_name(OUT NAME): NAME, and the sanitizers, since one run of CTest can hold several builds.
function(torquer_test_name out name)
  if(TORQUER_SANITIZE)
    string(REPLACE "," "+" sanitizers ${TORQUER_SANITIZE})
    string(APPEND name " (${sanitizers})")
  endif()
  set(${out} ${name} PARENT_SCOPE)
endfunction()

# torquer_timeout(OUT SECONDS): time after which CTest ends a test; default: 5 minutes, and three times as long under
# sanitizers. It leaves room for a loaded machine.
function(torquer_timeout out seconds)
  if(NOT seconds)
    set(seconds 300)
  endif()
  if(TORQUER_SANITIZE)
    math(EXPR seconds "3 * ${seconds}")
  endif()
  set(${out} ${seconds} PARENT_SCOPE)
endfunction()

# torquer_check(NAME LABEL l COMMAND word.. [TIMEOUT s] [COST s] [PROPERTIES name value..]): a CTest test that is no
# Catch2 program. PROPERTIES: those of CTest. COST: its approximate time. The longest tests begin first, so that no long
# test runs alone at the end.
function(torquer_check name)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "" "LABEL;TIMEOUT;COST" "COMMAND;PROPERTIES")
  torquer_timeout(timeout "${ARG_TIMEOUT}")
  torquer_test_name(full_name ${name})
  add_test(NAME ${full_name} COMMAND ${TORQUER_MEASURED} ${ARG_COMMAND})
  set_tests_properties(${full_name} PROPERTIES LABELS ${ARG_LABEL} TIMEOUT ${timeout}
    ${ARG_PROPERTIES})
  if(ARG_COST)
    set_tests_properties(${full_name} PROPERTIES COST ${ARG_COST})
  endif()
endfunction()

# torquer_test(NAME LABEL l SOURCES a_test.cpp.. LINK x.. [TIMEOUT s] [COST s] [PRELOAD library] [THREADED |
# THREADED_CASES spec] [REAL_TIME] [SANITIZED_BY_SOAK]): a Catch2 program. Its cases become CTest tests with that label.
# COST: of each case, as above. PRELOAD: runs under that library.
# THREADED: its code has threads, so the tsan build runs it. THREADED_CASES: the tsan build runs only the cases of
# Catch2's `spec`. REAL_TIME: it counts losses of a chain of programs. At most one other test runs beside it, and no
# other chain.
# SANITIZED_BY_SOAK: sanitizer builds run it by --soak alone.
function(torquer_test name)
  cmake_parse_arguments(ARG "THREADED;REAL_TIME;SANITIZED_BY_SOAK" "LABEL;TIMEOUT;COST;PRELOAD;THREADED_CASES" "SOURCES;LINK" ${ARGN})
  torquer_timeout(timeout "${ARG_TIMEOUT}")
  set(cases)
  set(runner ${TORQUER_MEASURED})
  if(ARG_PRELOAD)
    if(TORQUER_SANITIZE MATCHES "address")
      # AddressSanitizer insists on being the first library of all.
      execute_process(COMMAND ${CMAKE_CXX_COMPILER} -print-file-name=libasan.so
        OUTPUT_VARIABLE asan_library OUTPUT_STRIP_TRAILING_WHITESPACE)
      string(PREPEND ARG_PRELOAD ${asan_library}:)
    endif()
    list(APPEND runner env LD_PRELOAD=${ARG_PRELOAD})
  endif()
  set(CMAKE_CROSSCOMPILING_EMULATOR ${runner})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE torquer_build_rules torquer_test_support
    Catch2::Catch2WithMain torquer_test_options torquer_test_wires ${ARG_LINK})
  if(TORQUER_PRECOMPILE)
    target_precompile_headers(${name} REUSE_FROM torquer_precompiled_test_headers)
  endif()
  if(TORQUER_SANITIZE STREQUAL "thread")
    if(NOT ARG_THREADED AND NOT ARG_THREADED_CASES)
      set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ON)
      return()
    endif()
    target_sources(${name} PRIVATE ${PROJECT_SOURCE_DIR}/tests/support/tsan_suppressions.cpp)
    set(cases TEST_SPEC ${ARG_THREADED_CASES})
  endif()
  torquer_test_name(full_name ${name})
  set(properties LABELS ${ARG_LABEL} TIMEOUT ${timeout})
  if(ARG_COST)
    list(APPEND properties COST ${ARG_COST})
  endif()
  if(ARG_REAL_TIME)
    # These begin first. Later, small tests would take each place that becomes free, and these would run alone at the end.
    list(APPEND properties RESOURCE_LOCK real_time PROCESSORS 2 COST 400)
  endif()
  if(TORQUER_SANITIZE AND ARG_SANITIZED_BY_SOAK)
    # One test, so that CTest knows it whether it was built or not.
    add_test(NAME "${full_name}" COMMAND ${name})
    set_tests_properties("${full_name}" PROPERTIES LABELS soak TIMEOUT 1800)
    return()
  endif()
  add_dependencies(torquer_sanitizer_tests ${name})
  catch_discover_tests(${name} ${cases} TEST_PREFIX "${full_name}: " PROPERTIES ${properties})
endfunction()
