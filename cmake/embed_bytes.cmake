# Writes the bytes of files as C++: cmake -DFILES=a;b -D NAMESPACE=.. -D HEADER=.. -D OUT=..
# -P embed_bytes.cmake
set(arrays "")
set(list "")
set(index 0)
foreach(path ${FILES})
  get_filename_component(name ${path} NAME)
  file(READ ${path} hex HEX)
  string(REGEX REPLACE "(..)" "'\\\\x\\1'," bytes "${hex}")
  string(REPLACE "'\\x0a'," "'\\x0a',\n" bytes "${bytes}")
  string(APPEND arrays "constexpr char kBytes${index}[] = {\n${bytes}};\n")
  string(APPEND list "    {\"${name}\", {kBytes${index}, sizeof(kBytes${index})}},\n")
  math(EXPR index "${index} + 1")
endforeach()
file(WRITE ${OUT} "#include \"${HEADER}\"

namespace ${NAMESPACE} {

namespace {
${arrays}}  // namespace

const std::array<EmbeddedFile, ${index}> kFiles{{
${list}}};

}  // namespace ${NAMESPACE}
")
