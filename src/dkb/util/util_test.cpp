// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <thread>
#include <vector>

#include "dkb/util/bounded_queue.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/folder_lock.h"
#include "dkb/util/log.h"
#include "dkb/util/one_line.h"
#include "dkb/util/quantile.h"
#include "dkb/util/radix_sort.h"
#include "dkb/util/random.h"
#include "dkb/util/test_errors.h"
#include "dkb/util/test_folder.h"
#include "dkb/util/thread_priority.h"
#include "dkb/util/timing.h"

namespace dkb {
namespace {
namespace fs = std::filesystem;

TEST(RadixSort, AsByComparing) {
  Random random(5);
  for (const size_t n : {0, 1, 255, 256, 1000, 5000})
    for (const uint32_t range : {1u, 2000u, 1u << 22, 0xFFFFFFFFu}) {
      std::vector<uint32_t> values(n);
      for (uint32_t& v : values) v = static_cast<uint32_t>(random.uniform() * range) + (range < 3000 ? 1u << 30 : 0);
      std::vector<uint32_t> expected = values;
      std::sort(expected.begin(), expected.end());
      radix_sort(values);
      ASSERT_EQ(values, expected) << n << " below " << range;
    }
}

TEST(Random, SameSeedGivesTheSameNumbers) {
  Random a(7), b(7), c(8);
  EXPECT_EQ(a.next(), b.next());
  EXPECT_NE(a.next(), c.next());
}

TEST(Random, NormalHasUnitVariance) {
  Random r(1);
  double sum = 0, squares = 0;
  const int n = 100000;
  for (int i = 0; i < n; ++i) {
    const double x = r.normal();
    sum += x;
    squares += x * x;
  }
  EXPECT_NEAR(sum / n, 0.0, 0.02);
  EXPECT_NEAR(squares / n, 1.0, 0.02);
}

TEST(Random, BelowStaysInRangeAndReachesEveryValue) {
  Random r(3);
  std::vector<int> seen(7);
  for (int i = 0; i < 1000; ++i) ++seen.at(r.below(7));
  for (int count : seen) EXPECT_GT(count, 80);
}

TEST(OneLine, HasASpaceForControlCharacters) {
  EXPECT_EQ(one_line("a\nb\r\n\tc"), "a b c");
  EXPECT_EQ(one_line(std::string("\0x", 2)), "x");
  EXPECT_EQ(one_line("d\xC3\xA9j\xC3\xA0 vu~"), "d\xC3\xA9j\xC3\xA0 vu~") << "UTF-8 stays";
  EXPECT_EQ(one_line("Traceback:\n  line 3\r\nno memory\n"), "Traceback:  line 3 no memory");
}

TEST(Quantile, IsOneOfTheValues) {
  std::vector<float> values = {5, 1, 4, 2, 3, 8, 7, 6};
  EXPECT_EQ(quantile(values, 0), 1);
  EXPECT_EQ(quantile(values, 0.25), 3);
  EXPECT_EQ(quantile(values, 0.75), 7);
  EXPECT_EQ(quantile(values, 1), 8);
  EXPECT_EQ(upper_median(values), 5) << "the upper of 4 and 5";
  std::vector<int> odd = {9, 1, 5}, one = {3};
  EXPECT_EQ(upper_median(odd), 5);
  EXPECT_EQ(upper_median(one), 3);
  EXPECT_EQ(quantile(one, 1), 3);
}

TEST(BoundedQueue, KeepsOrderAcrossThreadsAndDrainsAfterClose) {
  BoundedQueue<int> queue(1000);
  const auto none = [](int, std::deque<int>&) { ADD_FAILURE() << "it is never full"; };
  std::vector<int> got;
  std::thread consumer([&] {
    while (auto v = queue.pop()) got.push_back(*v);
  });
  for (int i = 0; i < 1000; ++i) queue.push_dropping_oldest(i, none);
  queue.close();
  consumer.join();
  ASSERT_EQ(got.size(), 1000u);
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(got[static_cast<size_t>(i)], i);
  queue.push_dropping_oldest(1, none);
  EXPECT_EQ(queue.pop(), std::nullopt);
}

TEST(BoundedQueue, DropsTheOldestWhenAskedNotToWait) {
  BoundedQueue<int> queue(2);
  std::vector<int> left;
  const auto leave = [&](int dropped, const std::deque<int>& waiting) { left = {dropped, waiting.front()}; };
  EXPECT_EQ(queue.push_dropping_oldest(1, leave), 0u);
  EXPECT_EQ(queue.push_dropping_oldest(2, leave), 0u);
  EXPECT_EQ(queue.push_dropping_oldest(3, leave), 1u);
  EXPECT_EQ(left, (std::vector<int>{1, 2}));
  EXPECT_EQ(queue.pop(), 2);
  EXPECT_EQ(queue.pop(), 3);
}

TEST(Files, AtomicWriteReplacesTheWholeFile) {
  const fs::path folder = fs::path(::testing::TempDir()) / (std::to_string(::getpid()) + "dkb_files_test");
  make_output_folder(folder);
  write_file_atomically(folder / "a.txt", "first, and longer");
  write_file_atomically(folder / "a.txt", "second");
  EXPECT_EQ(read_file(folder / "a.txt"), "second");
  size_t entries = 0;
  for ([[maybe_unused]] const auto& e : fs::directory_iterator(folder)) ++entries;
  EXPECT_EQ(entries, 1u) << "no temporary file is left behind";
  fs::remove_all(folder);
}

TEST(Files, ThreadsThatWriteOneFileLeaveOneOfTheirContents) {
  const test::TempFolder temp;
  const fs::path path = temp / "a.txt";
  std::vector<std::string> contents;
  for (char c = 'a'; c < 'e'; ++c) contents.emplace_back(100'000, c);
  std::vector<std::thread> writers;
  for (const std::string& content : contents)
    writers.emplace_back([&] {
      for (int i = 0; i < 20; ++i) EXPECT_NO_THROW(write_file_atomically(path, content));
    });
  for (std::thread& w : writers) w.join();
  const std::string written = read_file(path);
  EXPECT_EQ(std::count(contents.begin(), contents.end(), written), 1);
  EXPECT_EQ(std::distance(fs::directory_iterator(temp.path()), fs::directory_iterator()), 1) << "nothing else is left";
}

TEST(Files, AGrowingFileIsWholeOrNotThere) {
  const test::TempFolder temp;
  const fs::path path = temp / "rows.csv", part = temp / "rows.csv.part";
  write_file_atomically(path, "before");
  {
    GrowingFile given_up(path, ".part");
    given_up.append("half");
    EXPECT_EQ(read_file(part), "half");
  }
  EXPECT_EQ(read_file(path), "before");
  EXPECT_FALSE(fs::exists(part));
  GrowingFile whole(path, ".part");
  for (const char* row : {"a\n", "b\n"}) whole.append(row);
  whole.commit();
  EXPECT_EQ(read_file(path), "a\nb\n");
  EXPECT_FALSE(fs::exists(part));
}

TEST(Files, AtomicWriteLeavesLinksAndPipesWhatTheyAre) {
  const test::TempFolder folder;
  write_file_atomically(folder / "file", "before");
  fs::create_symlink("file", folder / "link");
  write_file_atomically(folder / "link", "after");
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_EQ(read_file(folder / "file"), "after");
  fs::create_symlink("new", folder / "second");
  fs::create_symlink("second", folder / "first");
  write_file_atomically(folder / "first", "made");
  EXPECT_TRUE(fs::is_symlink(folder / "first") && fs::is_symlink(folder / "second"));
  EXPECT_EQ(read_file(folder / "new"), "made") << "it was not there before";
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  std::string got;
  std::thread reader([&] { got = read_file(folder / "pipe"); });
  write_file_atomically(folder / "pipe", "through");
  reader.join();
  EXPECT_EQ(got, "through");
  EXPECT_TRUE(fs::is_fifo(folder / "pipe"));
}

TEST(Files, AFolderInTheirPlaceStays) {
  const test::TempFolder folder;
  fs::create_directory(folder / "a");
  try {
    write_file_atomically(folder / "a", "x");
    FAIL() << "must throw";
  } catch (const OutputError& e) {
    FAIL() << "the disk is not full: " << e.what();
  } catch (const InputError&) {
  }
  EXPECT_TRUE(fs::is_empty(folder / "a"));
}

TEST(Files, OneThatIsTakenAwayWhileItIsWrittenIsNoBadPlace) {
  const test::TempFolder folder;
  GrowingFile file(folder / "a", ".part");
  file.append("x");
  fs::remove(folder / "a.part");
  try {
    file.commit();
    FAIL() << "must throw";
  } catch (const OutputError& e) {
    EXPECT_NE(std::string(e.what()).find("; something else took it away meanwhile"), std::string::npos) << e.what();
  }
}

TEST(Files, AreReadWholeWhetherTheyTellTheirSizeOrNot) {
  const test::TempFolder folder;
  const fs::path path = folder / "file";
  std::string content;
  for (const size_t size : {0, 1, 65535, 65536, 65537, 300000}) {
    while (content.size() < size) content += static_cast<char>(content.size() * 7 / 3);
    write_file_atomically(path, content);
    EXPECT_EQ(read_file(path), content);
    fs::remove(path);
    ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
    std::thread writer([&] { std::ofstream(path, std::ios::binary) << content; });
    EXPECT_EQ(read_file(path), content) << "from a pipe";
    writer.join();
    fs::remove(path);
  }
}

TEST(Files, AnUnwritablePlaceIsNamed) {
  try {
    write_file_atomically("/proc/nowhere/a.txt", "x");
    FAIL() << "must throw";
  } catch (const OutputError& e) {
    FAIL() << "the disk is not full: " << e.what();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("/proc/nowhere/a.txt"), std::string::npos);
    EXPECT_NE(std::string(e.what()).find("make the folder, or choose another"), std::string::npos);
  }
  EXPECT_THROW(make_output_folder("/proc/nowhere"), InputError);
  EXPECT_THROW(read_file("/nowhere/at/all"), InputError);
}

TEST(FolderLock, KeepsAFolderToOneWriterAndLeavesNothing) {
  const test::TempFolder folder;
  {
    const FolderLock held(folder.path());
    EXPECT_EQ(
        test::input_error_of([&] { FolderLock(folder.path()); }),
        folder.path().string() + ": another run is writing its results there; wait for it, or choose another folder");
    EXPECT_TRUE(fs::is_empty(folder.path()));
  }
  EXPECT_NO_THROW(FolderLock(folder.path()));
}

TEST(StageTimes, SummarisesWithPercentiles) {
  StageTimes a, b;
  for (int i = 1; i <= 50; ++i) a.add("x", i);
  for (int i = 51; i <= 100; ++i) b.add("x", i);
  a.merge(b);
  const StageSummary s = a.summaries().at("x");
  EXPECT_EQ(s.count, 100u);
  EXPECT_DOUBLE_EQ(s.mean_ms, 50.5);
  EXPECT_DOUBLE_EQ(s.max_ms, 100);
  EXPECT_NEAR(s.median_ms, 51, 0.005 * 51);
  EXPECT_NEAR(s.p95_ms, 96, 0.005 * 96);
}

TEST(StageTimes, QuantilesAreWithinHalfAPercentOfTheSortedOnes) {
  Random random(7);
  StageTimes times;
  std::vector<float> sorted;
  for (int i = 0; i < 10'000; ++i) {
    sorted.push_back(static_cast<float>(std::exp(random.uniform(std::log(1.1e-3), std::log(0.9e6)))));
    times.add("x", sorted.back());
    times.add("one", 0.1234F);
  }
  std::sort(sorted.begin(), sorted.end());
  const std::map<std::string, StageSummary> summaries = times.summaries();
  const StageSummary s = summaries.at("x");
  EXPECT_NEAR(s.median_ms / sorted[5000], 1, 0.005);
  EXPECT_NEAR(s.p95_ms / sorted[9500], 1, 0.005);
  EXPECT_EQ(s.max_ms, sorted.back());
  EXPECT_EQ(summaries.at("one").median_ms, 0.1234F) << "where all are the same";
}

TEST(StageTimes, WhatIsMergedIsAsIfAddedHere) {
  StageTimes a, b, both;
  for (const double ms : {5.0, 0.2, 70.0}) a.add("x", ms), both.add("x", ms);
  for (const double ms : {0.001, 900.0}) b.add("x", ms), both.add("x", ms);
  a.merge(b);
  EXPECT_EQ(a.histograms(), both.histograms());
  EXPECT_EQ(a.summaries().at("x").median_ms, both.summaries().at("x").median_ms);
  EXPECT_EQ(a.summaries().at("x").max_ms, 900);
}

TEST(StageTimes, CountsDurationsByQuarterOctaves) {
  StageTimes times;
  for (const double ms : {0.0, 0.001, 1.0, 1.1, 1.2, 1e9}) times.add("x", ms);
  const std::vector<int> counts = times.histograms().at("x");
  ASSERT_EQ(counts.size(), 64u);
  EXPECT_EQ(counts[0], 2);
  EXPECT_EQ(counts[20], 2) << "2^0 to 2^0.25 = 1.19 ms";
  EXPECT_EQ(counts[21], 1);
  EXPECT_EQ(counts[63], 1);
}

TEST(WarningLog, MergesRepeatedWarnings) {
  std::vector<std::string> lines;
  WarningLog log([&](const std::string& l) { lines.push_back(l); });
  log.warn("bad image", "frame 3 is bad");
  log.warn("bad image", "frame 4 is bad");
  log.warn("other", "once");
  log.finish();
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[0], "warning: frame 3 is bad");
  EXPECT_EQ(lines[2], "warning: bad image: 2 times in all");
}

TEST(ThreadPriority, ABackgroundThreadStepsBackAlone) {
  const auto nice = [] { return getpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid))); };
  const int here = nice();
  int background = here, normal = here;
  std::thread([&] {
    set_thread_priority(ThreadPriority::background);
    background = nice();
  }).join();
  std::thread([&] {
    set_thread_priority(ThreadPriority::normal);
    normal = nice();
  }).join();
  EXPECT_EQ(background, std::min(here + 10, 19));
  EXPECT_EQ(normal, here);
  EXPECT_EQ(nice(), here);
}

}  // namespace
}  // namespace dkb
