// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/access_rules.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

HttpRequest request(const std::string& path, std::vector<std::pair<std::string, std::string>> headers) {
  HttpRequest r;
  r.method = "GET";
  r.path = path;
  r.headers = std::move(headers);
  return r;
}
int of_host(const AccessRules& rules, const std::string& host) {
  return rules.refusal(request("/api/state", {{"host", host}}));
}

TEST(AccessRules, LetInLoopbackNamesAndThoseNamed) {
  const AccessRules rules{{"robot.lan"}, false, ""};
  for (const char* host : {"localhost", "LOCALHOST:80", "127.0.0.1:8090", "[::1]:8090", "robot.lan:1"})
    EXPECT_EQ(of_host(rules, host), 0) << host;
  for (const char* host : {"evil.example", "127.0.0.1.evil.example", "localhost:", "localhost:x", "localhost:80:80",
                           "[::1", "192.168.0.7", "", "localhost@evil"})
    EXPECT_EQ(of_host(rules, host), 403) << host;
  const AccessRules everywhere{{}, true, ""};
  EXPECT_EQ(of_host(everywhere, "192.168.0.7:8090"), 0);
  EXPECT_EQ(of_host(everywhere, "[fe80::1]:8090"), 0);
  EXPECT_EQ(of_host(everywhere, "evil.example"), 403);
}

TEST(AccessRules, LetTheMachinesOwnNameInWhereAllAddressesAre) {
  const auto admitted = [](const std::string& host, const std::string& machine, const std::string& name) {
    AccessRules rules = access_rules_of(host, machine);
    EXPECT_EQ(rules.token.empty(), host == "localhost");
    rules.token = "";
    return of_host(rules, name + ":8090") == 0;
  };
  for (const char* name : {"robot", "ROBOT.local", "192.168.0.7"})
    EXPECT_TRUE(admitted("0.0.0.0", "Robot", name)) << name;
  for (const char* name : {"evil.example", "robot.evil.example", "robot.lan", "local", ".local"})
    EXPECT_FALSE(admitted("0.0.0.0", "Robot", name)) << name;
  for (const char* name : {"robot", "robot.local", "robot.lan"}) {
    EXPECT_TRUE(admitted("::", "robot.lan", name)) << name;
    EXPECT_FALSE(admitted("192.168.0.7", "robot.lan", name)) << name;
    EXPECT_FALSE(admitted("localhost", "robot.lan", name)) << name;
    EXPECT_FALSE(admitted("0.0.0.0", "", name)) << name;
  }
  EXPECT_FALSE(admitted("0.0.0.0", "", ".local"));
}

TEST(AccessRules, KeepPagesOfOtherSitesOut) {
  const AccessRules rules;
  const auto from = [&](const std::string& path, const std::string& name, const std::string& value) {
    return rules.refusal(request(path, {{"host", "localhost:8090"}, {name, value}}));
  };
  EXPECT_EQ(from("/api/state", "origin", "http://localhost:8090"), 0);
  for (const char* origin : {"http://evil.example", "null", "https://localhost:8090", "http://localhost:9999"})
    EXPECT_EQ(from("/api/state", "origin", origin), 403) << origin;
  EXPECT_EQ(from("/api/state", "sec-fetch-site", "same-origin"), 0);
  EXPECT_EQ(from("/api/state", "sec-fetch-site", "cross-site"), 403);
  EXPECT_EQ(from("/", "sec-fetch-site", "cross-site"), 0);
}

TEST(AccessRules, AskForTheTokenBelowApi) {
  const AccessRules rules{{}, false, "0123"};
  const auto with = [&](const std::string& path, const std::string& token) {
    return rules.refusal(request(path, {{"host", "localhost"}, {"x-dkb-token", token}}));
  };
  EXPECT_EQ(with("/api/state", "0123"), 0);
  EXPECT_EQ(with("/api/state", "0124"), 401);
  EXPECT_EQ(with("/api/state", "012"), 401);
  EXPECT_EQ(of_host(rules, "localhost"), 401);
  EXPECT_EQ(rules.refusal(request("/", {{"host", "localhost"}})), 0);
  EXPECT_NE(random_token(), random_token());
  EXPECT_EQ(random_token().size(), 32U);
}

}  // namespace
}  // namespace dkb
