// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/access_rules.h"

#include <arpa/inet.h>
#include <sys/random.h>

#include <algorithm>
#include <array>
#include <cctype>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return out;
}

// The name of `name`, `name:port` or `[address]:port`, in lower case; empty when it is none of these.
std::string host_of(std::string_view authority) {
  size_t end = authority.starts_with('[') ? authority.find(']') : authority.find(':');
  if (authority.starts_with('[')) {
    if (end == std::string_view::npos) return {};
    ++end;
  }
  end = std::min(end, authority.size());
  const std::string_view port = authority.substr(end);
  if (!port.empty() && (port.size() < 2 || port.size() > 6 || port[0] != ':' ||
                        !std::all_of(port.begin() + 1, port.end(), [](char c) { return c >= '0' && c <= '9'; })))
    return {};
  return lower(authority.substr(0, end));
}

bool is_numeric_address(const std::string& host) {
  in6_addr address;
  if (host.starts_with('[')) return inet_pton(AF_INET6, host.substr(1, host.size() - 2).c_str(), &address) == 1;
  return inet_pton(AF_INET, host.c_str(), &address) == 1;
}

}  // namespace

bool is_loopback_name(std::string_view host) {
  return host == "localhost" || host == "127.0.0.1" || host == "[::1]" || host == "::1";
}

int AccessRules::refusal(const HttpRequest& request) const {
  const std::string_view authority = request.header("host");
  const std::string host = host_of(authority);
  const bool known = is_loopback_name(host) ||
                     std::find(host_names.begin(), host_names.end(), host) != host_names.end() ||
                     (any_address && is_numeric_address(host));
  if (host.empty() || !known) return 403;
  if (const std::string_view origin = request.header("origin"); !origin.empty()) {
    if (!origin.starts_with("http://") || origin.substr(7) != authority) return 403;
  }
  const std::string_view site = request.header("sec-fetch-site");
  const bool typed_or_ours = site.empty() || site == "same-origin" || site == "none";
  // A link from elsewhere may lead to the page itself.
  if (!typed_or_ours && (request.path.starts_with("/api/") || request.method != "GET")) return 403;
  if (!token.empty() && request.path.starts_with("/api/") &&
      !equal_in_constant_time(request.header("x-dkb-token"), token))
    return 401;
  return 0;
}

AccessRules access_rules_of(const std::string& host, const std::string& machine) {
  AccessRules rules;
  if (is_loopback_name(host)) return rules;
  rules.any_address = host == "0.0.0.0" || host == "::";
  const std::string name = lower(host), own = lower(machine), first = own.substr(0, own.find('.'));
  rules.host_names = {name.find(':') == std::string::npos ? name : "[" + name + "]"};
  if (rules.any_address && !first.empty()) {
    rules.host_names.insert(rules.host_names.end(), {first, first + ".local"});
    if (own != first) rules.host_names.push_back(own);
  }
  rules.token = random_token();
  return rules;
}

bool equal_in_constant_time(std::string_view given, std::string_view expected) {
  if (given.size() != expected.size()) return false;
  volatile unsigned difference = 0;
  for (size_t i = 0; i < expected.size(); ++i)
    difference = difference | (static_cast<unsigned char>(given[i]) ^ static_cast<unsigned char>(expected[i]));
  return difference == 0;
}

std::string random_token() {
  std::array<unsigned char, 16> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw InputError("--viewer-host: the system gives no random numbers for a token");
  std::string token;
  for (const unsigned char b : bytes) {
    token += "0123456789abcdef"[b >> 4];
    token += "0123456789abcdef"[b & 15];
  }
  return token;
}

}  // namespace dkb
