# cmake -D SHADERS="a.glsl;b.frag" -D OUTPUT=FILE.cpp -P embed_shaders.cmake: the shaders as a table of strings.
set(entries "")
foreach(path ${SHADERS})
  get_filename_component(name ${path} NAME)
  file(READ ${path} text)
  string(APPEND entries "      {\"${name}\", R\"glsl(${text})glsl\"},\n")
endforeach()
set(content "#include \"projector/shader.h\"\n\nnamespace limn::projector {\n
const std::map<std::string, std::string>& embedded_shaders() {
  static const std::map<std::string, std::string> shaders = {\n${entries}  };
  return shaders;
}\n\n}  // namespace limn::projector\n")
file(WRITE ${OUTPUT} "${content}")
