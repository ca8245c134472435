// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/page_files.h"

// The files lie in the folder that the build names with -Wa,-I.
#define DKB_EMBED(name, file)                                                                      \
  __asm__(".pushsection .rodata\n.global dkb_page_" #name "\ndkb_page_" #name ":\n.incbin \"" file \
          "\"\n"                                                                                   \
          ".global dkb_page_" #name "_end\ndkb_page_" #name "_end:\n.byte 0\n.popsection\n");      \
  extern "C" __attribute__((visibility("hidden"))) const char dkb_page_##name[], dkb_page_##name##_end[]

DKB_EMBED(index, "index.html");
DKB_EMBED(script, "app.js");
DKB_EMBED(style, "app.css");

namespace dkb {

const PageFile* page_file(std::string_view path) {
  static const PageFile files[] = {
      {"/", "text/html; charset=utf-8", {dkb_page_index, dkb_page_index_end}},
      {"/app.js", "text/javascript; charset=utf-8", {dkb_page_script, dkb_page_script_end}},
      {"/app.css", "text/css; charset=utf-8", {dkb_page_style, dkb_page_style_end}},
  };
  for (const PageFile& file : files)
    if (file.path == path) return &file;
  return nullptr;
}

}  // namespace dkb
