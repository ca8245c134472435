// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/session_file.h"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <fstream>

#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

namespace fs = std::filesystem;

class SessionFileTest : public testing::Test {
 protected:
  ~SessionFileTest() override { fs::remove(path_); }
  void write(const std::string& bytes) { std::ofstream(path_, std::ios::binary) << bytes; }
  void append(const std::string& bytes) { std::ofstream(path_, std::ios::binary | std::ios::app) << bytes; }

  const fs::path path_ = fs::temp_directory_path() / ("dkb_session_file_" + std::to_string(getpid()) + ".dkbs");
};

std::string chunk(uint32_t flags, int frame, const std::string& messages = "messages") {
  return chunk_head({flags, 0.1 * frame, frame, static_cast<uint32_t>(messages.size())}) + messages;
}

TEST_F(SessionFileTest, KnowsWhereOneMayBegin) {
  write(chunk(0, 0) + chunk(0, 1) + chunk(kCheckpoint, 1, "all") + chunk(kSessionEnd, 2, ""));
  const SessionFile file(path_);
  ASSERT_EQ(file.entries().size(), 2U);
  EXPECT_EQ(file.entries()[1].offset, 80U);
  EXPECT_EQ(file.read(80 + kChunkHead, 80 + kChunkHead + 3), "all");
  EXPECT_EQ(file.frames(), 3);
  EXPECT_DOUBLE_EQ(file.seconds(), 0.2);
  EXPECT_TRUE(file.ended());
  EXPECT_FALSE(file.damaged());
  EXPECT_EQ(file.read(file.size() - 2, file.size() + 100).size(), 2U);
  EXPECT_EQ(file.read(file.size() + 5, ~uint64_t{0}), "");
  EXPECT_EQ(file.read(10, 5), "");
}

TEST_F(SessionFileTest, GrowsWithTheFileAndSeesNoPartOfAChunk) {
  const std::string second = chunk(0, 1);
  write(chunk(0, 0));
  SessionFile file(path_);
  for (const size_t cut : {size_t{10}, kChunkHead, second.size() - 1}) {
    write(chunk(0, 0) + second.substr(0, cut));
    file.update();
    EXPECT_EQ(file.frame(), 0) << cut;
    EXPECT_EQ(file.size(), 40U);
  }
  write(chunk(0, 0) + second);
  file.update();
  EXPECT_EQ(file.frame(), 1);
  append("no chunk at all, but some 40 bytes of something");
  file.update();
  EXPECT_EQ(file.frame(), 1);
  EXPECT_TRUE(file.damaged());
}

TEST_F(SessionFileTest, KeepsFewPlacesOfALongSession) {
  std::string bytes;
  for (int i = 0; i < 15'000; ++i) bytes += chunk(kCheckpoint, i, "");
  write(bytes);
  const SessionFile file(path_);
  EXPECT_LE(file.entries().size(), SessionFile::kMaxEntries);
  EXPECT_GE(file.entries().size(), SessionFile::kMaxEntries / 2);
  EXPECT_EQ(file.entries()[0].offset, 0U);
  for (size_t i = 1; i < file.entries().size(); ++i)
    EXPECT_NEAR(file.entries()[i].frame - file.entries()[i - 1].frame, 8, 1) << i;
}

TEST_F(SessionFileTest, RefusesOtherFilesInOneLine) {
  for (const std::string& bytes :
       {std::string(), std::string("hello"), std::string(1000, 'x'), chunk(0, 0).substr(0, 39)}) {
    write(bytes);
    try {
      const SessionFile file(path_);
      FAIL() << "took " << bytes.size() << " bytes";
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).find(path_.string()), 0U);
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    }
  }
  EXPECT_THROW(SessionFile("/no/such.dkbs"), InputError);
  EXPECT_THROW(SessionFile("/tmp"), InputError);
}

TEST_F(SessionFileTest, SurvivesThousandsOfBrokenFiles) {
  std::string good;
  for (int i = 0; i < 12; ++i) good += chunk(i % 4 == 3 ? kCheckpoint : 0, i);
  const int memory = memfd_create("session", MFD_CLOEXEC);
  Random random(5);
  for (int i = 0; i < 5000; ++i) {
    const std::string bad = mutated(good, random);
    ASSERT_EQ(ftruncate(memory, 0), 0);
    ASSERT_EQ(pwrite(memory, bad.data(), bad.size(), 0), static_cast<ssize_t>(bad.size()));
    try {
      SessionFile file("/proc/self/fd/" + std::to_string(memory));
      file.update();
      EXPECT_LE(file.size(), bad.size());
      EXPECT_EQ(file.read(0, file.size()).size(), file.size());
    } catch (const InputError&) {
    }
  }
  close(memory);
}

}  // namespace
}  // namespace dkb
