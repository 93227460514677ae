# Files that a program carries in itself: every file of FOLDER is embedded in TARGET. The generated
# header HEADER, namespace NAMESPACE, lists them as kFiles: name and bytes.
#
#   weft_embed_files(TARGET FOLDER HEADER NAMESPACE)
function(weft_embed_files target folder header namespace)
  set(generated ${CMAKE_BINARY_DIR}/generated)
  get_filename_component(out ${generated}/${header} DIRECTORY)
  file(MAKE_DIRECTORY ${out})
  file(GLOB sources CONFIGURE_DEPENDS ${folder}/*)
  list(LENGTH sources count)
  file(CONFIGURE OUTPUT ${generated}/${header} @ONLY CONTENT [[
// Generated from the files of one folder: see cmake/embed_files.cmake.
#pragma once

#include <array>
#include <string_view>

namespace @namespace@ {

struct EmbeddedFile {
  std::string_view name;
  std::string_view bytes;
};

extern const std::array<EmbeddedFile, @count@> kFiles;

}  // namespace @namespace@
]])
  get_filename_component(name ${header} NAME_WE)
  set(code ${out}/${name}.cpp)
  add_custom_command(
    OUTPUT ${code}
    COMMAND ${CMAKE_COMMAND} "-DFILES=${sources}" -D NAMESPACE=${namespace} -D HEADER=${header}
            -D OUT=${code} -P ${CMAKE_SOURCE_DIR}/cmake/embed_bytes.cmake
    DEPENDS ${sources} ${CMAKE_SOURCE_DIR}/cmake/embed_bytes.cmake
    COMMENT "Embedding ${folder}"
    VERBATIM)
  target_sources(${target} PRIVATE ${code})
  target_include_directories(${target} PUBLIC ${generated})
endfunction()
