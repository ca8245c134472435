// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/tum_dataset.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/stamps.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {
namespace fs = std::filesystem;
using Pairs = std::vector<std::pair<size_t, size_t>>;

class TumFolder : public testing::Test {
 protected:
  TumFolder() : folder(fs::path(testing::TempDir()) / (std::to_string(::getpid()) + "dkb_tum_folder")) {
    fs::remove_all(folder);
    fs::create_directories(folder);
  }
  ~TumFolder() override { fs::remove_all(folder); }
  void write(const std::string& name, const std::string& text) const { write_file_atomically(folder / name, text); }
  // The message without the folder's path.
  std::string error() const {
    const std::string what = test::input_error_of([&] { open_tum_dataset(folder); }), prefix = folder.string() + "/";
    return what.rfind(prefix, 0) == 0 ? what.substr(prefix.size()) : what;
  }
  const fs::path folder;
};

TEST_F(TumFolder, AssociationsAreTakenAsTheyAre) {
  write("associations.txt",
        "# comment\r\n\r\n1.50 rgb/a.png 1.40 depth/a.png\r\n  2.5\trgb/b.png 1.40 depth/a.png extra");
  const TumDataset d = open_tum_dataset(folder);
  EXPECT_EQ(d.list, "associations.txt");
  ASSERT_EQ(d.pairs.size(), 2u);
  EXPECT_EQ(d.pairs[0].stamp, "1.50") << "as written, not as a number";
  EXPECT_EQ(d.pairs[0].timestamp, 1.5);
  EXPECT_EQ(d.pairs[1].depth_timestamp, 1.4) << "a depth image may serve twice; no limit on the difference";
  EXPECT_EQ(d.pairs[1].colour_path, folder / "rgb/b.png");
  EXPECT_EQ(d.pairs[1].depth_path, folder / "depth/a.png");
}

TEST_F(TumFolder, DepthThatComesFirstIsToldByItsFolderWhereverThatLies) {
  for (const std::string root : {"", "./", "/data/depth_camera/", "seq/"}) {
    SCOPED_TRACE(root);
    write("associations.txt", "1.4 " + root + "depth/a.png 1.5 " + root + "rgb/a.png\n");
    const TumDataset depth_first = open_tum_dataset(folder);
    EXPECT_EQ(depth_first.pairs[0].stamp, "1.5");
    EXPECT_EQ(depth_first.pairs[0].depth_path, folder / (root + "depth/a.png"));
    write("associations.txt", "1.5 " + root + "rgb/a.png 1.4 " + root + "depth/a.png\n");
    EXPECT_EQ(open_tum_dataset(folder).pairs[0].stamp, "1.5");
  }
  write("associations.txt", "1.4 depth_a.png 1.5 rgb_a.png\n");
  EXPECT_EQ(open_tum_dataset(folder).pairs[0].stamp, "1.5") << "without folders, by its name";
  write("associations.txt", "1.4 depth/left/a.png 1.5 rgb/left/a.png\n");
  EXPECT_EQ(open_tum_dataset(folder).pairs[0].stamp, "1.5");
}

TEST_F(TumFolder, ListsArePairedByStamp) {
  write("rgb.txt", "#\n1.00 rgb/a\n1.03 rgb/b\n1.06 rgb/c\n");
  write("depth.txt", "0.99 d/a\n1.035 d/b\n1.2 d/c\n");
  const TumDataset d = open_tum_dataset(folder);
  ASSERT_EQ(d.pairs.size(), 2u);
  EXPECT_EQ(d.pairs[1].depth_stamp, "1.035");
  EXPECT_EQ(d.pairs[1].colour_path, folder / "rgb/b");
}

TEST_F(TumFolder, FaultsNameFileAndLine) {
  EXPECT_EQ(error().find("rgb.txt: no such file; a dataset needs associations.txt, or rgb.txt and depth.txt"), 0u);
  write("rgb.txt", "1 a\n2 b\n");
  EXPECT_EQ(error().find("depth.txt: no such file; a dataset needs associations.txt, or rgb.txt and depth.txt"), 0u);
  write("depth.txt", "101 a\n102 b\n");
  EXPECT_EQ(
      error(),
      "rgb.txt: no colour image has a depth image of depth.txt within 0.020 s; the two lists must be of one recording "
      "and one clock");
  write("depth.txt", "1 a\n3 b\n2.9 c\n");
  EXPECT_EQ(error(), "depth.txt:3: timestamp 2.9 is not after the line before it (3); sort the file by time");
  write("depth.txt", "1 a\n1.0 b\n");
  EXPECT_EQ(error(), "depth.txt:2: timestamp 1.0 is given twice; remove one of the rows");
  write("rgb.txt", "# only a comment\n");
  EXPECT_EQ(error(), "rgb.txt: holds no row `timestamp filename`");
  write("rgb.txt", "# x\nx1.5 a\n");
  EXPECT_EQ(error(), "rgb.txt:2: timestamp \"x1.5\" is not a number");
  write("rgb.txt", "1.5\n");
  EXPECT_EQ(error(), "rgb.txt:1: 1 of 2 columns; a row must be `timestamp filename`");
  write("associations.txt", "1 a 1 b\nnan a 2 b\n");
  EXPECT_EQ(error(), "associations.txt:2: timestamp \"nan\" is not a finite number");
  write("associations.txt", "1 a 1 b\n2 a inf b\n");
  EXPECT_EQ(error(), "associations.txt:2: depth timestamp \"inf\" is not a finite number");
  write("associations.txt", "1 a 1\n");
  EXPECT_EQ(error(),
            "associations.txt:1: 3 of 4 columns; a row must be `rgb_timestamp rgb_file depth_timestamp depth_file`");
  write("associations.txt", "1 a 1 b\n1 a 2 b\n");
  EXPECT_EQ(error(), "associations.txt:2: timestamp 1 is given twice; remove one of the rows");
  EXPECT_THROW(open_tum_dataset(folder / "nowhere"), InputError);
  EXPECT_THROW(open_tum_dataset(folder / "rgb.txt"), InputError);
}

TEST(Associate, NearestPairsComeFirstAndEachIsUsedOnce) {
  // 1.010 is nearer to 1.012 than 1.000 is: 1.000 must take 0.985.
  EXPECT_EQ(associate({1.000, 1.010}, {0.985, 1.012}), (Pairs{{0, 0}, {1, 1}}));
  // Both want 1.005; the first of equals gets it, the other stays alone.
  EXPECT_EQ(associate({1.0, 1.010}, {1.005}).size(), 1u);
  // Exactly 0.02 s apart is near enough, also where the difference of the doubles is a little more.
  EXPECT_EQ(associate({1305031102.16}, {1305031102.18}).size(), 1u);
  EXPECT_EQ(associate({1305031102.16}, {1305031102.180002}).size(), 0u);
  EXPECT_TRUE(associate({}, {1.0}).empty());
}

TEST(Associate, EqualsTheExhaustiveSearch) {
  Random random(5);
  for (int trial = 0; trial < 100; ++trial) {
    std::vector<double> a, b;
    double t = 0, u = 0;
    for (int i = 0; i < 40; ++i)
      a.push_back(t += random.uniform(0.001, 0.04)), b.push_back(u += random.uniform(0.001, 0.04));
    Pairs expected;
    std::vector<bool> a_used(a.size()), b_used(b.size());
    for (;;) {  // the nearest free pair, again and again
      double best = 0.02;
      std::pair<size_t, size_t> pair{a.size(), b.size()};
      for (size_t i = 0; i < a.size(); ++i)
        for (size_t j = 0; j < b.size(); ++j)
          if (!a_used[i] && !b_used[j] && std::abs(a[i] - b[j]) < best) best = std::abs(a[i] - b[j]), pair = {i, j};
      if (pair.first == a.size()) break;
      a_used[pair.first] = b_used[pair.second] = true;
      expected.push_back(pair);
    }
    std::sort(expected.begin(), expected.end());
    EXPECT_EQ(associate(a, b), expected);
  }
}

// All pairs that are near enough, the nearest first: what associate() means, at the cost of listing them.
Pairs listed(const std::vector<double>& a, const std::vector<double>& b, double limit) {
  std::vector<std::tuple<double, size_t, size_t>> all;
  for (size_t i = 0; i < a.size(); ++i)
    for (size_t j = 0; j < b.size(); ++j)
      if (b[j] >= a[i] - limit && b[j] <= a[i] + limit) all.emplace_back(std::abs(a[i] - b[j]), i, j);
  std::sort(all.begin(), all.end());
  std::vector<bool> a_used(a.size()), b_used(b.size());
  Pairs pairs;
  for (const auto& [difference, i, j] : all) {
    if (a_used[i] || b_used[j]) continue;
    a_used[i] = b_used[j] = true;
    pairs.emplace_back(i, j);
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

TEST(Associate, TakesOfEquallyNearAndOfDensePairsWhatListingThemAllTakes) {
  Random random(11);
  for (int trial = 0; trial < 300; ++trial) {
    // Whole milliseconds, so that many are equally near; from some 40 a frame to gaps of several frames.
    const double step = trial % 3 == 0 ? 0.001 : 0.03;
    std::vector<double> a, b;
    for (std::vector<double>* list : {&a, &b}) {
      double t = 1700000000;
      for (int i = 0; i < 20 + trial % 40; ++i)
        list->push_back(t += 0.001 * std::ceil(1000 * random.uniform(1e-4, 2 * step)));
    }
    const double limit = trial % 2 == 0 ? 0.02 : 0.005;
    EXPECT_EQ(associate(a, b, limit), listed(a, b, limit + kStampRounding)) << trial;
  }
}

TEST(Associate, DenseListsTakeNoMoreMemoryThanTheirLength) {
  // 40,000 stamps a microsecond apart: 800 million pairs are near enough.
  std::vector<double> a, b;
  for (int i = 0; i < 40000; ++i) a.push_back(1e-6 * i), b.push_back(1e-6 * i + 2.5e-7);
  const Pairs pairs = associate(a, b);
  ASSERT_EQ(pairs.size(), a.size());
  for (size_t i = 0; i < pairs.size(); ++i) ASSERT_EQ(pairs[i], std::pair(i, i));
}

TumDataset ten_pairs() {
  TumDataset d;
  for (int i = 0; i < 10; ++i) {
    DatasetPair pair;
    pair.timestamp = 1305031102.175304 + 0.1 * i;
    d.pairs.push_back(pair);
  }
  return d;
}

TEST(SelectPairs, StartAndEndAreInclusiveAndCountedFromTheFirstPair) {
  TumDataset d = ten_pairs();
  select_pairs({.start = 0.2, .end = 0.5, .max_frames = {}}, &d);
  ASSERT_EQ(d.pairs.size(), 4u);
  EXPECT_NEAR(d.pairs.front().timestamp, 1305031102.375304, 1e-6);
}

TEST(SelectPairs, MaxFramesCountFromStart) {
  TumDataset d = ten_pairs();
  select_pairs({.start = 0.65, .max_frames = 2}, &d);
  ASSERT_EQ(d.pairs.size(), 2u);
  EXPECT_NEAR(d.pairs.front().timestamp, 1305031102.875304, 1e-6);
}

TEST(SelectPairs, NonsenseIsRefused) {
  TumDataset d = ten_pairs();
  EXPECT_THROW(select_pairs({.start = -1, .max_frames = {}}, &d), InvalidOption);
  EXPECT_THROW(select_pairs({.start = 2, .end = 1, .max_frames = {}}, &d), InvalidOption);
  EXPECT_EQ(test::input_error_of([&] { select_pairs({.start = 2.5, .end = 1, .max_frames = {}}, &d); }),
            "--end: 1 is out of range; it must be at least that of --start, 2.5 s");
  EXPECT_THROW(select_pairs({.max_frames = 0}, &d), InvalidOption);
  EXPECT_THROW(select_pairs({.start = 100, .max_frames = {}}, &d), InputError);
}

TEST(ImageLists, MutatedListsThrowNothingButInputErrors) {
  Random random(31);
  const std::string list = "# timestamp filename\n1305031102.175304 rgb/a.png\n1305031102.211214 rgb/b.png\n";
  const std::string pairs =
      "1305031102.1753 rgb/a.png 1305031102.16 depth/a.png\n1305031102.21 rgb/b.png 1305031102.22 d\n";
  for (int i = 0; i < 4000; ++i) {
    try {
      parse_image_list(mutated(list, random), "rgb.txt");
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    }
    try {
      parse_associations(mutated(pairs, random), "associations.txt", "folder");
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace dkb
