// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dkb/viewer/http_request.h"

namespace dkb {

// Who may ask for what. A page of another site can send requests from a visitor's browser, under its own name or, by a
// DNS entry of its own, under a name that leads here; both are told by Host, Origin and Sec-Fetch-Site.
struct AccessRules {
  std::vector<std::string> host_names;  // beside the loopback names; in lower case
  bool any_address = false;             // numeric addresses of any kind too: bound to all of this machine's
  std::string token;                    // of requests below /api/, in the header X-Dkb-Token; empty = none is asked for

  // 0: it may. 403: a foreign name or page. 401: the token is missing or wrong.
  int refusal(const HttpRequest& request) const;
};

// Of a server that is bound to `host` on a machine of the name `machine`, which may be empty: by a random token for all
// but loopback names. One that listens on all addresses answers to that name and to NAME.local as well; of a full name
// to its first part, too. Nobody else can have such a name resolved to another place here. Throws as random_token().
AccessRules access_rules_of(const std::string& host, const std::string& machine);

// Takes as long for every `given` of the same length.
bool equal_in_constant_time(std::string_view given, std::string_view expected);

// 128 random bits in hexadecimal. Throws InputError when the system gives none.
std::string random_token();

// Loopback addresses and names.
bool is_loopback_name(std::string_view host);

}  // namespace dkb
