# What `cmake --install` installs, by component, and the Debian packages that `cpack` makes of it:
#
#   cmake --build build && (cd build && cpack)
#
# weft: the command, weft-open beside it, the Python module, completion, manual pages, the user and
# the configuration that the services share. weft-coordinator, weft-worker, weft-render: a service
# and its unit each.
include(GNUInstallDirs)

# The programs write their own manual pages and completion; nothing of it is kept twice.
set(pages ${CMAKE_BINARY_DIR}/share)
# Whoever builds is not who reads: defaults below the home folder are told as ~/...
set(as_anybody ${CMAKE_COMMAND} -E env --unset=XDG_CONFIG_HOME --unset=XDG_DATA_HOME
  --unset=XDG_CACHE_HOME HOME=~)
add_custom_command(
  OUTPUT ${pages}/written
  COMMAND ${CMAKE_COMMAND} -E rm -rf ${pages}
  COMMAND ${CMAKE_COMMAND} -E make_directory ${pages}/man8 ${pages}/completion
  COMMAND ${as_anybody} $<TARGET_FILE:weft> man --all ${pages}/man1
  COMMAND ${as_anybody} $<TARGET_FILE:weft-coordinator> __man > ${pages}/man8/weft-coordinator.8
  COMMAND ${as_anybody} $<TARGET_FILE:weft-worker> __man > ${pages}/man8/weft-worker.8
  COMMAND ${as_anybody} $<TARGET_FILE:weft-render> __man > ${pages}/man8/weft-render.8
  COMMAND weft completion bash > ${pages}/completion/weft
  COMMAND weft completion zsh > ${pages}/completion/_weft
  COMMAND weft completion fish > ${pages}/completion/weft.fish
  COMMAND sh -c "gzip -9nk ${pages}/man1/*.1 ${pages}/man8/*.8"
  COMMAND ${CMAKE_COMMAND} -E touch ${pages}/written
  DEPENDS weft weft-coordinator weft-worker weft-render
  COMMENT "Writing manual pages and completion"
  VERBATIM)
add_custom_target(weft_pages ALL DEPENDS ${pages}/written)

set(system_units /usr/lib/systemd/system)
install(TARGETS weft weft-open RUNTIME COMPONENT weft)
install(DIRECTORY ${pages}/man1 DESTINATION ${CMAKE_INSTALL_MANDIR} COMPONENT weft
  FILES_MATCHING PATTERN "*.gz")
# bash and fish look completion up by the name of the program.
foreach(program weft weft-coordinator weft-worker weft-render)
  install(FILES ${pages}/completion/weft RENAME ${program}
    DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT ${program})
  install(FILES ${pages}/completion/weft.fish RENAME ${program}.fish
    DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT ${program})
  install(FILES ${CMAKE_SOURCE_DIR}/deploy/debian/copyright
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${program} COMPONENT ${program})
endforeach()
install(FILES ${pages}/completion/_weft
  DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions COMPONENT weft)
install(FILES ${CMAKE_SOURCE_DIR}/deploy/debian/weft.toml DESTINATION /etc/weft COMPONENT weft)
install(FILES ${CMAKE_SOURCE_DIR}/deploy/debian/weft.sysusers RENAME weft.conf
  DESTINATION /usr/lib/sysusers.d COMPONENT weft)
install(FILES ${CMAKE_SOURCE_DIR}/deploy/debian/weft-render.sysusers RENAME weft-render.conf
  DESTINATION /usr/lib/sysusers.d COMPONENT weft-render)
install(DIRECTORY ${CMAKE_SOURCE_DIR}/examples/
  DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/weft/examples COMPONENT weft
  FILES_MATCHING PATTERN "*.textproto")
# Where Debian's python3 looks; the module's own dependencies are suggested alone.
install(DIRECTORY ${CMAKE_BINARY_DIR}/python/weft DESTINATION /usr/lib/python3/dist-packages
  COMPONENT weft FILES_MATCHING PATTERN "*.py" PATTERN "weft.protoset" PATTERN "__pycache__" EXCLUDE)
foreach(program coordinator worker render)
  install(TARGETS weft-${program} RUNTIME COMPONENT weft-${program})
  install(FILES ${pages}/man8/weft-${program}.8.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man8
    COMPONENT weft-${program})
endforeach()
install(FILES ${CMAKE_SOURCE_DIR}/deploy/systemd/weft-coordinator.service
  DESTINATION ${system_units} COMPONENT weft-coordinator)
install(FILES ${CMAKE_SOURCE_DIR}/deploy/systemd/weft-worker@.service
  DESTINATION ${system_units} COMPONENT weft-worker)
install(FILES ${CMAKE_SOURCE_DIR}/deploy/systemd/weft-render.service
  DESTINATION ${system_units} COMPONENT weft-render)

# Packaging takes what is built; it builds nothing that it does not install.
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)

# What dpkg runs: deploy/debian/*.in, with the unit's name in it.
set(scripts ${CMAKE_BINARY_DIR}/debian)
foreach(program weft weft-coordinator weft-worker weft-render)
  set(SYSUSERS ${program})
  set(UNIT ${program}.service)
  set(UNIT_PATTERN ${program}.service)
  if(program STREQUAL weft-worker)
    set(UNIT "weft-worker@.service")  # all its instances
    set(UNIT_PATTERN "weft-worker@*.service")
  endif()
  set(kind service)
  if(program STREQUAL weft)
    set(kind command)
  endif()
  foreach(script postinst prerm postrm)
    set(source ${CMAKE_SOURCE_DIR}/deploy/debian/${kind}.${script}.in)
    if(EXISTS ${source})
      configure_file(${source} ${scripts}/${program}/${script} @ONLY
        FILE_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE
                         WORLD_READ WORLD_EXECUTE)
      list(APPEND control_${program} ${scripts}/${program}/${script})
    endif()
  endforeach()
endforeach()
file(WRITE ${scripts}/weft/conffiles "/etc/weft/weft.toml\n")
list(APPEND control_weft ${scripts}/weft/conffiles)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME weft)
set(CPACK_PACKAGE_CONTACT "The weft developers <weft@localhost>")
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_RESOURCE_FILE_LICENSE ${CMAKE_SOURCE_DIR}/LICENSE)
set(CPACK_COMPONENTS_ALL weft weft-coordinator weft-worker weft-render)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_SET_DESTDIR ON)  # there is something in /etc
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz CACHE STRING "xz, or gzip where time matters more than size")
set(CPACK_DEBIAN_WEFT_PACKAGE_NAME weft)
set(CPACK_DEBIAN_WEFT_PACKAGE_DEPENDS "systemd | systemd-standalone-sysusers")
set(CPACK_DEBIAN_WEFT_PACKAGE_RECOMMENDS "mesa-vulkan-drivers | vulkan-icd")
set(CPACK_DEBIAN_WEFT_PACKAGE_SUGGESTS "bash-completion, python3-grpcio, python3-h5py, \
python3-numpy, python3-protobuf, weft-coordinator, weft-worker, weft-render")
set(CPACK_COMPONENT_WEFT_DESCRIPTION
  "fibre-level cloth: precomputation and pictures
 The command with which fabrics are described, precomputed, looked at and
 rendered, here or on a cluster, and the program that reads files from
 strangers for it.")
set(CPACK_COMPONENT_WEFT-COORDINATOR_DESCRIPTION
  "scheduler and catalogue of weft
 Shares the precomputation of fabrics out among workers and keeps the
 versions of the databases that come of it. A service with a unit.")
set(CPACK_COMPONENT_WEFT-WORKER_DESCRIPTION
  "worker of weft
 Computes shards of fabrics for a coordinator. A service with a unit of
 which as many instances run as one likes.")
set(CPACK_COMPONENT_WEFT-RENDER_DESCRIPTION
  "render node of weft
 Draws scenes of published fabrics on a GPU, or without one. A service with
 a unit.")
foreach(program weft weft-coordinator weft-worker weft-render)
  string(TOUPPER ${program} name)
  set(CPACK_DEBIAN_${name}_PACKAGE_NAME ${program})
  set(CPACK_DEBIAN_${name}_PACKAGE_CONTROL_EXTRA ${control_${program}})
  if(NOT program STREQUAL weft)
    # Programs of one version belong together; the user and the configuration are weft's.
    set(CPACK_DEBIAN_${name}_PACKAGE_DEPENDS "weft (= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})")
  endif()
endforeach()
include(CPack)
