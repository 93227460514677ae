// The system's tinyobjloader knows no coverage: here it is built with it, in place of the library.
#define TINYOBJLOADER_IMPLEMENTATION
#include <tiny_obj_loader.h>
