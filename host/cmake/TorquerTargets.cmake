# How targets are defined here, so that every one carries the same rules.

# Everything in bin/ that a person runs: tests hold all of it to the same command line.
add_custom_target(torquer_programs)

# torquer_library(NAME SOURCES a.cpp.. LINK x..): a static library of this project.
function(torquer_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  target_link_libraries(${name} PUBLIC torquer_build_rules ${ARG_LINK})
endfunction()

# torquer_program(NAME SOURCES main.cpp.. LINK x..): a program in bin/, with the command line of
# host/support/program.h.
function(torquer_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE torquer_build_rules ${ARG_LINK} torquer_support)
  add_dependencies(torquer_programs ${name})
endfunction()

# torquer_helper(NAME SOURCES main.cpp.. LINK x..): a program in bin/helpers/ that only tests run.
function(torquer_helper name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE torquer_build_rules ${ARG_LINK})
  set_target_properties(${name} PROPERTIES
    RUNTIME_OUTPUT_DIRECTORY ${CMAKE_RUNTIME_OUTPUT_DIRECTORY}/helpers)
endfunction()

# torquer_test(NAME LABEL l SOURCES a_test.cpp.. LINK x.. [ENVIRONMENT K=V..] [TIMEOUT s]
#   [THREADED] [SERIAL]):
# a Catch2 program whose cases become CTest tests with that label. THREADED: its code has threads,
# so the tsan build holds it too (target torquer_threaded_tests); that build leaves out the others.
# SERIAL: each case has the machine to itself.
function(torquer_test name)
  cmake_parse_arguments(ARG "THREADED;SERIAL" "LABEL;TIMEOUT" "SOURCES;LINK;ENVIRONMENT" ${ARGN})
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
  target_link_libraries(${name} PRIVATE torquer_build_rules torquer_test_main ${ARG_LINK})
  if(TORQUER_SANITIZE STREQUAL "thread" AND NOT ARG_THREADED)
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ON)
    return()
  endif()
  catch_discover_tests(${name}
    TEST_PREFIX ${prefix}
    PROPERTIES LABELS "${ARG_LABEL}" TIMEOUT ${ARG_TIMEOUT} ENVIRONMENT "${ARG_ENVIRONMENT}"
      RUN_SERIAL ${ARG_SERIAL})
  if(ARG_THREADED)
    add_dependencies(torquer_threaded_tests ${name})
  endif()
endfunction()
