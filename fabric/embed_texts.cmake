# Writes OUTPUT, a C++ source that holds every text of examples/ (fabrics) and of its presets/yarns
# and presets/materials: cmake -D EXAMPLES=... -D OUTPUT=... -P embed_texts.cmake
set(entries "")
foreach(kind fabric material yarn)
  if(kind STREQUAL "fabric")
    file(GLOB files ${EXAMPLES}/*.textproto)
  else()
    file(GLOB files ${EXAMPLES}/presets/${kind}s/*.textproto)
  endif()
  list(SORT files)
  foreach(path ${files})
    get_filename_component(name ${path} NAME_WE)
    file(READ ${path} text)
    string(APPEND entries "    {\"${kind}\", \"${name}\", R\"textproto(${text})textproto\"},\n")
  endforeach()
endforeach()
file(WRITE ${OUTPUT} "// Made by fabric/embed_texts.cmake.\n#include \"fabric/presets.h\"\n
namespace weft::fabric {\n\nstd::span<const EmbeddedText> embedded_texts() {
  static constexpr EmbeddedText kTexts[] = {\n${entries}  };
  return kTexts;\n}\n\n}  // namespace weft::fabric\n")
