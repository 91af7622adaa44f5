# CPack gives the package of a shared library maintainer scripts that call ldconfig. Debian has a
# trigger for that (library/triggers), so they are taken out again.
foreach(package ${CPACK_PACKAGE_FILES})
  if(NOT package MATCHES "/libtorquer[0-9.]+_[^/]*$")
    continue()
  endif()
  set(unpacked ${package}.unpacked)
  execute_process(COMMAND dpkg-deb -R ${package} ${unpacked} COMMAND_ERROR_IS_FATAL ANY)
  file(REMOVE ${unpacked}/DEBIAN/postinst ${unpacked}/DEBIAN/postrm)
  execute_process(COMMAND dpkg-deb --root-owner-group -b ${unpacked} ${package} OUTPUT_QUIET
    COMMAND_ERROR_IS_FATAL ANY)
  file(REMOVE_RECURSE ${unpacked})
endforeach()
