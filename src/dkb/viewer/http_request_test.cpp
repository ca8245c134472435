// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/http_request.h"

#include <gtest/gtest.h>

#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

using State = HttpRequestParser::State;

const std::string kPost =
    "POST /api/command HTTP/1.1\r\nHost: 127.0.0.1:8090\r\nOrigin: http://127.0.0.1:8090\r\n"
    "Content-Type: application/json\r\nContent-Length: 14\r\n\r\n{\"do\":\"pause\"}";

int status_of(const std::string& bytes) {
  HttpRequestParser parser;
  const State state = parser.feed(bytes);
  return state == State::complete ? 200 : state == State::reading ? 0 : parser.status();
}
std::string get(const std::string& target, const std::string& headers = "Host: localhost\r\n") {
  return "GET " + target + " HTTP/1.1\r\n" + headers + "\r\n";
}

TEST(HttpRequestParser, ReadsARequestInAnyPieces) {
  for (size_t piece = 1; piece <= kPost.size(); ++piece) {
    HttpRequestParser parser;
    for (size_t at = 0; at < kPost.size(); at += piece) {
      ASSERT_EQ(parser.state(), State::reading);
      parser.feed(std::string_view(kPost).substr(at, piece));
    }
    ASSERT_EQ(parser.state(), State::complete);
    EXPECT_EQ(parser.request().method, "POST");
    EXPECT_EQ(parser.request().path, "/api/command");
    EXPECT_EQ(parser.request().header("host"), "127.0.0.1:8090");
    EXPECT_EQ(parser.request().body, "{\"do\":\"pause\"}");
  }
}

TEST(HttpRequestParser, TellsWhatAQueryAsksFor) {
  HttpRequestParser parser;
  ASSERT_EQ(parser.feed(get("/api/stream?images=1&depth&x=2")), State::complete);
  EXPECT_TRUE(parser.request().asks_for("images"));
  EXPECT_TRUE(parser.request().asks_for("depth"));
  EXPECT_FALSE(parser.request().asks_for("x"));
  EXPECT_FALSE(parser.request().asks_for("image"));
}

TEST(HttpRequestParser, RefusesWhatItDoesNotNeed) {
  EXPECT_EQ(status_of(get("/")), 200);
  EXPECT_EQ(status_of(get("/../etc/passwd")), 404);
  EXPECT_EQ(status_of(get("/%2e%2e/etc/passwd")), 404);
  EXPECT_EQ(status_of(get("/a\\b")), 404);
  EXPECT_EQ(status_of(get("http://evil.example/")), 404);
  EXPECT_EQ(status_of("PUT / HTTP/1.1\r\nHost: a\r\n\r\n"), 405);
  EXPECT_EQ(status_of("GET / HTTP/2.0\r\nHost: a\r\n\r\n"), 505);
  EXPECT_EQ(status_of("GET  / HTTP/1.1\r\nHost: a\r\n\r\n"), 400);
  EXPECT_EQ(status_of("GET /\r\n\r\n"), 400);
  EXPECT_EQ(status_of("\x16\x03\x01\r\n\r\n"), 400);
  EXPECT_EQ(status_of(get("/", "")), 400);
  EXPECT_EQ(status_of(get("/", "Host: a\r\nHost: b\r\n")), 400);
  EXPECT_EQ(status_of(get("/", "Host: a\r\n folded\r\n")), 400);
  EXPECT_EQ(status_of(get("/", "Host : a\r\n")), 400);
  EXPECT_EQ(status_of(get("/", "Host: a\nb\r\n")), 400);
  EXPECT_EQ(status_of(get("/", "Host: a\r\nContent-Length: 3\r\n") + "abc"), 400);
}

TEST(HttpRequestParser, BoundsSizes) {
  const auto post = [](const std::string& headers) { return "POST / HTTP/1.1\r\nHost: a\r\n" + headers + "\r\n"; };
  EXPECT_EQ(status_of(post("")), 411);
  EXPECT_EQ(status_of(post("Transfer-Encoding: chunked\r\n")), 411);
  EXPECT_EQ(status_of(post("Transfer-Encoding: chunked\r\nContent-Length: 1\r\n") + "x"), 411);
  EXPECT_EQ(status_of(post("Content-Length: 4097\r\n")), 413);
  EXPECT_EQ(status_of(post("Content-Length: 99999999999999999999\r\n")), 413);
  EXPECT_EQ(status_of(post("Content-Length: -1\r\n")), 400);
  EXPECT_EQ(status_of(post("Content-Length: 1\r\nContent-Length: 2\r\n")), 400);
  EXPECT_EQ(status_of(post("Content-Length: 4096\r\n") + std::string(4096, 'x')), 200);
  EXPECT_EQ(status_of(get("/" + std::string(2000, 'a'))), 414);
  EXPECT_EQ(status_of(std::string(20000, 'a')), 414);
  EXPECT_EQ(status_of(get("/", "Host: a\r\nX: " + std::string(9000, 'a') + "\r\n")), 431);
  std::string many = "Host: a\r\n";
  for (int i = 0; i < 70; ++i) many += "X: y\r\n";
  EXPECT_EQ(status_of(get("/", many)), 431);
}

TEST(HttpRequestParser, SurvivesMutations) {
  Random random(7);
  const std::string samples[] = {kPost, get("/api/stream?images=1", "Host: localhost\r\nX-Dkb-Token: abc\r\n")};
  int complete = 0;
  for (int i = 0; i < 20000; ++i) {
    const std::string bytes = mutated(samples[i % 2], random);
    HttpRequestParser parser;
    const size_t cut = random.below(static_cast<uint32_t>(bytes.size() + 1));
    parser.feed(std::string_view(bytes).substr(0, cut));
    const State state = parser.feed(std::string_view(bytes).substr(cut));
    if (state == State::refused) {
      EXPECT_GE(parser.status(), 400);
    } else if (state == State::complete) {
      ++complete;
      const HttpRequest& r = parser.request();
      EXPECT_TRUE(r.method == "GET" || r.method == "POST");
      EXPECT_EQ(r.path.front(), '/');
      EXPECT_EQ(r.path.find(".."), std::string::npos);
      EXPECT_LE(r.body.size(), HttpRequestParser::kMaxBody);
      EXPECT_FALSE(r.header("host").empty());
    }
  }
  EXPECT_GT(complete, 500);
}

TEST(HttpRequest, ReadsWholeNumbersOfTheQuery) {
  HttpRequest request;
  request.query = "n=1&from=0&to=18446744073709551615&far=18446744073709551616&minus=-1&half=1.5&empty=&bare";
  EXPECT_EQ(request.number("n"), 1U);
  EXPECT_EQ(request.number("from"), 0U);
  EXPECT_EQ(request.number("to"), ~uint64_t{0});
  for (const char* name : {"far", "minus", "half", "empty", "bare", "fro", "missing"})
    EXPECT_FALSE(request.number(name)) << name;
}

}  // namespace
}  // namespace dkb
