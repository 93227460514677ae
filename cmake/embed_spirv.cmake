# Writes the words of a SPIR-V file as C++: cmake -D SPIRV=.. -D NAME=.. -D NAMESPACE=.. -D HEADER=..
# -D OUT=.. -P embed_spirv.cmake
file(READ ${SPIRV} hex HEX)
# Words are little-endian in the file, as every device that we build for has them.
string(REGEX REPLACE "(..)(..)(..)(..)" "0x\\4\\3\\2\\1,\n" words "${hex}")
file(WRITE ${OUT} "#include \"${HEADER}\"

namespace ${NAMESPACE} {

namespace {
constexpr std::uint32_t kWords[] = {
${words}};
}  // namespace

constinit const KernelCode ${NAME}{\"${NAME}\", kWords};

}  // namespace ${NAMESPACE}
")
