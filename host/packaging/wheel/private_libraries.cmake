# Copies the shared libraries of ${programs} into torquer/lib of the wheel. Copies the licenses of all libraries in it
# into torquer/licenses.
set(folder ${CMAKE_INSTALL_PREFIX}/torquer)
file(GET_RUNTIME_DEPENDENCIES EXECUTABLES ${programs} RESOLVED_DEPENDENCIES_VAR libraries
  PRE_EXCLUDE_REGEXES "^(ld-linux-x86-64|libc|libm|libgcc_s|libstdc[+][+])[.]so")
# Packages whose code the module and the programs contain without a file for it.
set(packages libcli11-dev libeigen3-dev libfmt-dev libtomlplusplus-dev nlohmann-json3-dev pybind11-dev libstdc++6)
file(MAKE_DIRECTORY ${folder}/lib ${folder}/licenses)
foreach(library ${libraries})
  get_filename_component(name ${library} NAME)
  file(REAL_PATH ${library} file)
  file(COPY_FILE ${file} ${folder}/lib/${name})
  get_filename_component(file ${file} NAME)
  execute_process(COMMAND dpkg-query --search */${file} OUTPUT_VARIABLE owner COMMAND_ERROR_IS_FATAL ANY)
  string(REGEX MATCH "^[^:, ]+" owner "${owner}")
  list(APPEND packages ${owner})
endforeach()
list(REMOVE_DUPLICATES packages)
foreach(package ${packages})
  file(COPY_FILE /usr/share/doc/${package}/copyright ${folder}/licenses/${package})
endforeach()
