# The two ways a target comes into being here, so that every one carries the same rules.

# torquer_library(NAME SOURCES a.cpp.. LINK x..): a static library of this project.
function(torquer_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  target_link_libraries(${name} PUBLIC torquer_build_rules ${ARG_LINK})
endfunction()

# torquer_program(NAME SOURCES main.cpp.. LINK x..): a program in bin/.
function(torquer_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE torquer_build_rules ${ARG_LINK})
endfunction()

# torquer_test(NAME LABEL l SOURCES a_test.cpp.. LINK x.. [ENVIRONMENT K=V..] [TIMEOUT s]):
# a Catch2 program whose cases become CTest tests with that label.
function(torquer_test name)
  cmake_parse_arguments(ARG "" "LABEL;TIMEOUT" "SOURCES;LINK;ENVIRONMENT" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE torquer_build_rules torquer_test_main ${ARG_LINK})
  catch_discover_tests(${name}
    TEST_PREFIX "${name}: "
    PROPERTIES LABELS "${ARG_LABEL}" TIMEOUT ${ARG_TIMEOUT} ENVIRONMENT "${ARG_ENVIRONMENT}")
endfunction()
