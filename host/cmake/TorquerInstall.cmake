# Install rules for "cmake --install". Other files install programs with their manual pages
# (TorquerTargets.cmake), the firmware and the library (host/api). The reader of surfaces
# (host/simulator/vessel) and the Python package (host/python) have their rules too. Each component
# becomes a Debian package (host/packaging).
set(data ${CMAKE_INSTALL_DATADIR}/torquer)

# torquer_install_data(FOLDER word..): scenes and devices, with the further words of install().
function(torquer_install_data folder)
  install(DIRECTORY host/scenes/ DESTINATION ${folder}/scenes ${ARGN}
    FILES_MATCHING PATTERN "*.toml" PATTERN "*.csv" PATTERN "surface.*" PATTERN "*.mrk.json"
    PATTERN "pictures" EXCLUDE)
  install(DIRECTORY host/devices/ DESTINATION ${folder}/devices ${ARGN}
    FILES_MATCHING PATTERN "*.toml")
endfunction()
# torquer_install_mesh_licenses(FOLDER word..): the licenses of the meshes in the scenes.
function(torquer_install_mesh_licenses folder)
  install(DIRECTORY host/scenes/meshes DESTINATION ${folder}/scenes ${ARGN}
    FILES_MATCHING PATTERN LICENSE PATTERN centerlines EXCLUDE)
endfunction()
torquer_install_data(${data} COMPONENT common)
set(wheel torquer/share/torquer COMPONENT wheel EXCLUDE_FROM_ALL)
torquer_install_data(${wheel})
torquer_install_mesh_licenses(${wheel})
# 3D Slicer finds the module in the folder that its settings name.
install(DIRECTORY host/slicer/Torquer DESTINATION ${data}/slicer COMPONENT python
  FILES_MATCHING PATTERN "*.py" PATTERN __pycache__ EXCLUDE)
install(DIRECTORY calibration/ DESTINATION ${data}/calibration COMPONENT programs
  FILES_MATCHING PATTERN "*.toml" PATTERN "*.script")
install(FILES hardware/udev/70-torquer.rules DESTINATION lib/udev/rules.d COMPONENT programs)
# The unit in the tree names /usr/local/bin, for users who copy it by hand.
install(CODE "
  file(READ \"${PROJECT_SOURCE_DIR}/hardware/systemd/torquer-daemon@.service\" unit)
  string(REPLACE /usr/local/bin \"\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_BINDIR}\" unit \"\${unit}\")
  file(CONFIGURE OUTPUT \"${CMAKE_CURRENT_BINARY_DIR}/torquer-daemon@.service\" CONTENT \"\${unit}\" @ONLY)
  " COMPONENT programs)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/torquer-daemon@.service DESTINATION lib/systemd/user
  COMPONENT programs)


# Documents with their pictures. They keep their relative paths, so that their links work.
set(documents .github/*.md tests/*.md tests/hil/*.md tests/hil/*/*.md)
foreach(ending md svg png jpg webm csv scad)
  list(APPEND documents *.${ending} calibration/*.${ending} firmware/*.${ending}
    firmware/*/*.${ending} hardware/*.${ending} hardware/*/*.${ending} protocol/*.${ending}
    host/*.${ending} host/*/*.${ending} host/*/*/*.${ending} host/*/*/*/*.${ending})
endforeach()
file(GLOB documents CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR} ${documents})
list(FILTER documents EXCLUDE REGEX "^host/scenes/.*[.]csv$")
foreach(document ${documents})
  get_filename_component(folder ${document} DIRECTORY)
  install(FILES ${document} DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/torquer/${folder}
    COMPONENT documentation)
endforeach()

# Debian has these in the file "copyright" of each package.
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/torquer COMPONENT licenses)
torquer_install_mesh_licenses(${data} COMPONENT licenses)

# The build tree has the layout of an installation, so that programs find their files in one way
# (host/support/installed.h).
function(torquer_lay_out target below_build)
  set(link ${PROJECT_BINARY_DIR}/${below_build})
  get_filename_component(folder ${link} DIRECTORY)
  file(MAKE_DIRECTORY ${folder})
  file(RELATIVE_PATH target ${folder} ${target})
  file(CREATE_LINK ${target} ${link} SYMBOLIC)
endfunction()
torquer_lay_out(${PROJECT_SOURCE_DIR}/host/devices share/torquer/devices)
torquer_lay_out(${PROJECT_SOURCE_DIR}/host/scenes share/torquer/scenes)
torquer_lay_out(${PROJECT_BINARY_DIR}/firmware share/torquer/firmware)
torquer_lay_out(${CMAKE_RUNTIME_OUTPUT_DIRECTORY}/helpers/torquer-mesh-reader
  libexec/torquer/torquer-mesh-reader)
