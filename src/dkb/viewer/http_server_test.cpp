// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/http_server.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pthread.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <ctime>
#include <thread>
#include <vector>

#include "dkb/viewer/page_server.h"

namespace dkb {
namespace {

// Numbers the parts that it is asked for.
class Service final : public HttpService {
 public:
  class Parts final : public HttpStream {
   public:
    std::string next() override { return std::string(part_++ < 3 ? 100000 : 0, 'x'); }

   private:
    int part_ = 0;
  };
  HttpAnswer answer(const HttpRequest& request) override {
    HttpAnswer answer;
    if (request.path == "/throw") throw std::bad_alloc();
    if (request.path == "/large")
      answer.body = large_;
    else if (request.path == "/stream")
      answer.stream = std::make_unique<Parts>();
    else
      answer.own_body = request.method + " " + request.path + " " + request.body;
    return answer;
  }
  void tick(size_t) override {}

 private:
  const std::string large_ = std::string(size_t{16} << 20, 'x');  // more than the kernel holds for a client
};

sockaddr_in loopback(uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

int connect_at(int port) {
  const int fd = socket(AF_INET, SOCK_STREAM, 0);
  const sockaddr_in address = loopback(static_cast<uint16_t>(port));
  EXPECT_EQ(connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  const timeval patience{10, 0};
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  return fd;
}

std::string all_of(int fd) {
  std::string all;
  char buffer[65536];
  for (ssize_t n = 0; (n = recv(fd, buffer, sizeof buffer, 0)) > 0;) all.append(buffer, static_cast<size_t>(n));
  close(fd);
  return all;
}

std::string ask_at(int port, const std::string& bytes) {
  const int fd = connect_at(port);
  send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  return all_of(fd);
}

std::string get_request(const std::string& path) {
  return "GET " + path + " HTTP/1.1\r\nHost: localhost\r\n\r\n";
}

class HttpServerTest : public testing::Test {
 protected:
  static HttpServer::Limits limits() {
    using std::chrono::milliseconds;
    return {milliseconds(300), milliseconds(1000), milliseconds(500),
            milliseconds(200), milliseconds(200),  milliseconds(5)};
  }
  ~HttpServerTest() override {
    server_.stop();
    thread_.join();
  }
  int connect_to() const { return connect_at(server_.port()); }
  std::string ask(const std::string& bytes) const { return ask_at(server_.port(), bytes); }
  std::string get(const std::string& path) const { return ask(get_request(path)); }

  Service service_;
  HttpServer server_{"127.0.0.1", 0, {}, service_, limits()};
  std::thread thread_{[this] { server_.run(); }};
};

TEST_F(HttpServerTest, AnswersAndCloses) {
  const std::string answer = get("/a");
  EXPECT_TRUE(answer.starts_with("HTTP/1.1 200 OK\r\n")) << answer;
  EXPECT_TRUE(answer.ends_with("\r\n\r\nGET /a ")) << answer;
  for (const char* header : {"Content-Security-Policy: default-src 'none'", "Connection: close", "nosniff"})
    EXPECT_NE(answer.find(header), std::string::npos) << header;
}

TEST_F(HttpServerTest, AnswersARefusalToAClientThatIsStillSending) {
  const std::string head = "POST /a HTTP/1.1\r\nHost: localhost\r\nContent-Length: 3000000\r\n\r\n";
  EXPECT_TRUE(ask(head + std::string(3000000, 'x')).starts_with("HTTP/1.1 413 "));
  EXPECT_TRUE(ask("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n").starts_with("HTTP/1.1 403 "));
}

TEST_F(HttpServerTest, StreamsPartAfterPart) {
  const int fd = connect_to();
  const std::string request = "GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n";
  send(fd, request.data(), request.size(), MSG_NOSIGNAL);
  const std::string all = all_of(fd);  // until the server gives a stream up that says nothing
  EXPECT_EQ(all.size() - all.find("\r\n\r\n") - 4, 300000U);
}

TEST_F(HttpServerTest, GivesUpOnRequestsThatComeSlowly) {
  const int fd = connect_to();
  const timeval between{0, 30000};
  setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &between, sizeof between);
  size_t sent = 0;
  ssize_t received = -1;
  for (const char c : std::string("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")) {
    if (send(fd, &c, 1, MSG_NOSIGNAL) != 1) break;
    ++sent;
    char answer;
    received = recv(fd, &answer, 1, 0);
    if (received >= 0) break;
  }
  close(fd);
  EXPECT_LE(received, 0) << "there is no answer";
  EXPECT_LT(sent, 30U);
}

TEST_F(HttpServerTest, ServesBesideAThousandIdleConnections) {
  std::vector<int> idle;
  for (int i = 0; i < 900; ++i) idle.push_back(connect_to());
  EXPECT_TRUE(get("/b").starts_with("HTTP/1.1 200 "));
  for (const int fd : idle) close(fd);
  EXPECT_TRUE(get("/c").starts_with("HTTP/1.1 200 "));
}

TEST_F(HttpServerTest, ServesBesideConnectionsThatDoNotTakeTheirAnswers) {
  std::vector<int> deaf;
  for (size_t i = 0; i < HttpServer::kMaxConnections; ++i) {
    deaf.push_back(connect_to());
    const std::string request = get_request("/large");
    send(deaf.back(), request.data(), request.size(), MSG_NOSIGNAL);
  }
  poll(nullptr, 0, static_cast<int>(limits().stuck.count()) + 200);
  EXPECT_NE(ask(get_request("/x")).find("GET /x"), std::string::npos);
  for (const int fd : deaf) close(fd);
}

TEST_F(HttpServerTest, RestsWhileNoDescriptorIsLeftForWhoKnocks) {
  // Sanitizers need a descriptor to look at an object that they do not know yet: none is looked at below.
  const pthread_t thread = thread_.native_handle();
  const auto busy_ms = [thread] {
    clockid_t clock{};
    timespec used{};
    pthread_getcpuclockid(thread, &clock);
    clock_gettime(clock, &used);
    return 1e3 * static_cast<double>(used.tv_sec) + 1e-6 * static_cast<double>(used.tv_nsec);
  };
  const int fd = socket(AF_INET, SOCK_STREAM, 0);
  const sockaddr_in address = loopback(static_cast<uint16_t>(server_.port()));
  rlimit before{};
  getrlimit(RLIMIT_NOFILE, &before);
  rlimit few = before;
  few.rlim_cur = static_cast<rlim_t>(fd) + 8;
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &few), 0);
  std::vector<int> taken;
  for (int copy = 0; (copy = dup(fd)) >= 0;) taken.push_back(copy);
  const int connected = connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address);
  const double at_first = busy_ms();
  poll(nullptr, 0, 300);
  const double busy = busy_ms() - at_first;
  for (const int copy : taken) close(copy);
  setrlimit(RLIMIT_NOFILE, &before);
  EXPECT_EQ(connected, 0);
  EXPECT_LT(busy, 50) << "[ms] of 300";
  const std::string request = "GET /b HTTP/1.1\r\nHost: localhost\r\n\r\n";
  send(fd, request.data(), request.size(), MSG_NOSIGNAL);
  EXPECT_TRUE(all_of(fd).starts_with("HTTP/1.1 200 "));
}

TEST(PageServer, ThatCannotGoOnLetsNobodyInAndSaysWhy) {
  Service service;
  PageServer page("127.0.0.1", 0, service);
  page.start();
  const std::string url = page.url();
  const auto port = static_cast<uint16_t>(std::stoi(url.substr(url.rfind(':') + 1)));
  EXPECT_EQ(ask_at(port, get_request("/throw")), "");
  const int fd = socket(AF_INET, SOCK_STREAM, 0);
  const sockaddr_in address = loopback(port);
  EXPECT_NE(connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  close(fd);
  std::vector<std::string> warnings;
  while (warnings.empty()) warnings = page.take_warnings();
  EXPECT_EQ(warnings, std::vector<std::string>{"the page has ended (std::bad_alloc); the run goes on without it"});
}

TEST_F(HttpServerTest, HasAQuotaForStreams) {
  std::vector<int> streams;
  const std::string request = "GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n";
  for (size_t i = 0; i < HttpServer::kMaxStreams; ++i) {
    streams.push_back(connect_to());
    send(streams.back(), request.data(), request.size(), MSG_NOSIGNAL);
    char c;
    EXPECT_EQ(recv(streams.back(), &c, 1, 0), 1);
  }
  EXPECT_TRUE(get("/stream").starts_with("HTTP/1.1 503 "));
  EXPECT_TRUE(get("/d").starts_with("HTTP/1.1 200 "));
  for (const int fd : streams) close(fd);
}

}  // namespace
}  // namespace dkb
