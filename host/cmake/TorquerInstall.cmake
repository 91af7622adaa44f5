# What "cmake --install" puts where, besides the programs (TorquerTargets.cmake), the library
# (host/api) and the Python package (host/python).
set(data ${CMAKE_INSTALL_DATADIR}/torquer)
install(DIRECTORY host/scenes/ DESTINATION ${data}/scenes COMPONENT programs)
install(DIRECTORY host/devices/ DESTINATION ${data}/devices COMPONENT programs)
install(DIRECTORY ${PROJECT_BINARY_DIR}/firmware/ DESTINATION ${data}/firmware COMPONENT programs
  FILES_MATCHING PATTERN "*.hex" PATTERN "CMakeFiles" EXCLUDE)
install(FILES hardware/udev/70-torquer.rules DESTINATION lib/udev/rules.d COMPONENT programs)
install(FILES LICENSE README.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT programs)
file(READ hardware/systemd/torquer-daemon@.service unit)
string(REPLACE /usr/local/bin ${CMAKE_INSTALL_FULL_BINDIR} unit "${unit}")
file(CONFIGURE OUTPUT torquer-daemon@.service CONTENT "${unit}" @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/torquer-daemon@.service DESTINATION lib/systemd/user
  COMPONENT programs)
