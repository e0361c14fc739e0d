# What `cmake --install BUILD [--prefix X] [--component program|cad|data|docs|library|development|python]` installs. The installed tree can be moved: the program
# finds its data and its own libraries from where it is (core/data_folder.h).
set(data ${CMAKE_INSTALL_DATADIR}/limn)
set(install_files ${PROJECT_SOURCE_DIR}/tools/install)

install(TARGETS limn RUNTIME COMPONENT program)
if(TARGET limn-cad)
  install(TARGETS limn-cad RUNTIME COMPONENT cad)
endif()
# The shared libraries that are loaded when they are needed. Those that liblimn.so needs, too, are installed once more for
# it, because the program's package and the library's do not need each other.
set(both limn_loaded_exr limn_loaded_markers limn_loaded_meshes limn_loaded_mrcal limn_loaded_volumes)
install(TARGETS limn_room_dds limn_loaded_gige limn_loaded_printing limn_loaded_rays limn_loaded_video ${both}
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/limn COMPONENT program)
install(TARGETS ${both} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/liblimn COMPONENT library)
install(FILES ${install_files}/limn.desktop DESTINATION ${CMAKE_INSTALL_DATADIR}/applications COMPONENT program)
install(FILES ${install_files}/io.github.limn.metainfo.xml
  DESTINATION ${CMAKE_INSTALL_DATADIR}/metainfo COMPONENT program)
install(FILES ${PROJECT_SOURCE_DIR}/remote/web/icon.svg RENAME limn.svg
  DESTINATION ${CMAKE_INSTALL_DATADIR}/icons/hicolor/scalable/apps COMPONENT program)
install(FILES ${install_files}/70-limn.rules DESTINATION lib/udev/rules.d COMPONENT program)
# systemd needs the program's whole path, which is known when it is installed.
install(CODE "set(program \"\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_BINDIR}/limn\")
  configure_file(\"${install_files}/limn-live.service.in\"
    \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/lib/systemd/user/limn-live.service\" @ONLY)" COMPONENT program)

install(DIRECTORY ${PROJECT_SOURCE_DIR}/config DESTINATION ${data} COMPONENT data PATTERN "README.md" EXCLUDE)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/remote/web DESTINATION ${data}/remote COMPONENT data
  PATTERN "README.md" EXCLUDE)
file(WRITE ${PROJECT_BINARY_DIR}/data-version "${PROJECT_VERSION}\n")
install(FILES ${PROJECT_BINARY_DIR}/data-version RENAME version DESTINATION ${data} COMPONENT data)

# The pages keep their places to each other, so that their links work.
install(FILES ${PROJECT_SOURCE_DIR}/README.md ${PROJECT_SOURCE_DIR}/CHANGELOG.md ${PROJECT_SOURCE_DIR}/CONTRIBUTING.md
  DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/limn-doc COMPONENT docs)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/limn-doc COMPONENT docs
  PATTERN "Doxyfile" EXCLUDE PATTERN "doxygen.sed" EXCLUDE)
install(FILES ${PROJECT_SOURCE_DIR}/config/README.md
  DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/limn-doc/config COMPONENT docs)
