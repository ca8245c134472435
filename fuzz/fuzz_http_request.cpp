// SPDX-License-Identifier: Apache-2.0
// Requests to the live page, cut in two pieces. The first byte tells where.
#include <cstdint>
#include <string_view>

#include "dkb/viewer/access_rules.h"
#include "dkb/viewer/http_request.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  const size_t cut = bytes.size() * data[0] / 256;
  dkb::HttpRequestParser parser;
  parser.feed(bytes.substr(0, cut));
  if (parser.feed(bytes.substr(cut)) == dkb::HttpRequestParser::State::complete) {
    const dkb::AccessRules open{{"robot"}, false, ""}, closed{{"robot"}, false, "secret"};
    if (open.refusal(parser.request()) == 0 && closed.refusal(parser.request()) == 0)
      parser.request().asks_for("images");
  }
  return 0;
}
