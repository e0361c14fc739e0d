# The manual pages and the completions of the shells, made by the program from its own table of commands.
include(GNUInstallDirs)
set(documents ${PROJECT_BINARY_DIR}/documents)
set(writing)
foreach(format man bash zsh fish)
  list(APPEND writing COMMAND ${CMAKE_COMMAND} -E make_directory ${documents}/${format}
    COMMAND limn help --format ${format} --out ${documents}/${format})
endforeach()
add_custom_command(OUTPUT ${documents}/written ${writing} COMMAND ${CMAKE_COMMAND} -E touch ${documents}/written
  DEPENDS limn COMMENT "Writing manual pages and completions" VERBATIM)
add_custom_target(limn_documents ALL DEPENDS ${documents}/written)

install(DIRECTORY ${documents}/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program)
install(DIRECTORY ${documents}/bash/ DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT program)
install(DIRECTORY ${documents}/zsh/ DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions COMPONENT program)
install(DIRECTORY ${documents}/fish/ DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT program)
