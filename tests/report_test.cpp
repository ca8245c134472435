// SPDX-License-Identifier: Apache-2.0
// DIR/report.html, as `dkb-slam run` writes it.
#include <gtest/gtest.h>

#include <regex>

#include "e2e_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

// Empty when every element is closed in its turn and every attribute is quoted; else what is wrong.
std::string not_well_formed(const std::string& html) {
  std::vector<std::string> open;
  for (size_t at = html.find('<'); at != std::string::npos; at = html.find('<', at)) {
    if (html.compare(at, 4, "<!--") == 0) {
      at = html.find("-->", at);
      continue;
    }
    size_t end = at + 1;
    for (char quote = 0; end < html.size() && (quote != 0 || html[end] != '>'); ++end) {
      if (html[end] == '"') quote = quote == 0 ? '"' : 0;
      if (html[end] == '<') return "a < in " + html.substr(at, 80);
    }
    const std::string tag = html.substr(at + 1, end - at - 1);
    at = end;
    if (tag.starts_with('!')) continue;
    const std::string name = tag.substr(0, tag.find_first_of(" \n/", 1));
    static const std::regex attributes(R"re(/?[A-Za-z0-9]+(\s+[A-Za-z][A-Za-z0-9:-]*="[^"]*")*\s*/?)re");
    // Pictures are longer than what a regular expression likes.
    if (tag.size() < 2000 && !std::regex_match(tag, attributes)) return "the tag " + tag;
    if (tag.ends_with('/')) continue;
    if (!tag.starts_with('/')) {
      open.push_back(name);
    } else {
      if (open.empty() || "/" + open.back() != name)
        return name + " where " + (open.empty() ? "" : open.back()) + " is open";
      open.pop_back();
    }
  }
  return open.empty() ? "" : open.back() + " is never closed";
}

std::string by_id(const std::string& html, const std::string& id) {
  const std::string mark = "id=\"" + id + "\">";
  const size_t at = html.find(mark);
  if (at == std::string::npos) return "none";
  return html.substr(at + mark.size(), html.find('<', at) - at - mark.size());
}

// Without what a clock had a say in.
std::string without_times(std::string html) {
  for (size_t at = html.find("<!--clock-->"); at != std::string::npos; at = html.find("<!--clock-->", at))
    html.erase(at, html.find("<!--/clock-->", at) - at);
  return html;
}

void expect_sound(const std::string& html) {
  EXPECT_EQ(not_well_formed(html), "");
  EXPECT_LT(html.size(), 3'000'000u);
  // What is shown comes with the page.
  for (const char* word : {"http://", "https://", "<script", "<link", "@import", "url(", "src="})
    EXPECT_EQ(html.find(word), std::string::npos) << word;
}

TEST(Report, VerdictIsThatOfStatsAndEval) {
  const TempFolder temp;
  const SlamRun run(sequence(), temp / "out", {"--set", "features.count=850"});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  const std::string html = read_text(run.out / "report.html");
  expect_sound(html);
  EXPECT_EQ(by_id(html, "tracked"), std::to_string(run.stats.at("tracked").get<int>()));
  EXPECT_EQ(by_id(html, "frames"), std::to_string(run.stats.at("frames").get<int>()));
  EXPECT_EQ(by_id(html, "lost-frames"), std::to_string(run.stats.at("lost").get<int>()));
  char ape[32];
  std::snprintf(ape, sizeof ape, "%.4f", ape_of(sequence(), run.out / "trajectory.txt"));
  EXPECT_EQ(by_id(html, "ape"), ape);
  EXPECT_NE(html.find("every frame was tracked"), std::string::npos);
  EXPECT_NE(html.find("<td>features.count</td><td>850</td><td>900</td>"), std::string::npos);
  EXPECT_NE(html.find("data:image/jpeg;base64,"), std::string::npos);
}

TEST(Report, SameRunGivesTheSamePageButForTimes) {
  const TempFolder temp;
  const SlamRun a(sequence(), temp / "a"), b(sequence(), temp / "b", {"--threads", "1"});
  EXPECT_TRUE(without_times(read_text(a.out / "report.html")) == without_times(read_text(b.out / "report.html")));
}

TEST(Report, IsNamedByTheFolderAlsoWhereThatIsGivenAsADot) {
  const TempFolder temp;
  const SlamRun run(sequence() / ".", temp / "out", {"--max-frames", "3"});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  const std::string html = read_text(run.out / "report.html");
  EXPECT_NE(html.find(sequence().filename().string() + "</title>"), std::string::npos);
}

TEST(Report, NamesWhyAStretchIsLost) {
  const TempFolder temp;
  ASSERT_EQ(run_program({"simulate", "--out", (temp / "dark").string(), "--scene", "room", "--people", "0", "--frames",
                         "45", "--blackout", "0.7,0.3"})
                .exit_code,
            0);
  const SlamRun run(temp / "dark", temp / "out", {"--debug-log"});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  ASSERT_GT(run.stats.at("lost"), 0);
  EXPECT_NE(
      read_text(run.out / "debug.log").find(" lost: 0 features, 0 with depth on what stands still, 0 fit the map\n"),
      std::string::npos);
  const std::string html = read_text(run.out / "report.html");
  expect_sound(html);
  EXPECT_EQ(by_id(html, "lost-frames"), std::to_string(run.stats.at("lost").get<int>()));
  EXPECT_NE(html.find("<p class=\"cause\">no features</p><p>0 features a frame, usually"), std::string::npos);
  EXPECT_NE(html.find("the picture is dark: grey level 0 of 255"), std::string::npos);
}

TEST(Report, IsWrittenWithoutTruthAndWithoutAPose) {
  const TempFolder temp;
  copy_sequence(temp / "data", 10, false);
  fs::remove(temp / "data" / "groundtruth.txt");
  const SlamRun plain(temp / "data", temp / "plain");
  const std::string html = read_text(plain.out / "report.html");
  expect_sound(html);
  EXPECT_EQ(by_id(html, "ape"), "none");
  EXPECT_NE(html.find("Uncertainty of the position"), std::string::npos);

  const SlamRun never(temp / "data", temp / "never", {"--set", "tracking.initial_points=100000"});
  EXPECT_EQ(never.finished.exit_code, 1);
  const std::string empty = read_text(never.out / "report.html");
  expect_sound(empty);
  EXPECT_NE(empty.find("No frame has a pose"), std::string::npos);
  EXPECT_NE(empty.find("before the first map"), std::string::npos);

  write_text(temp / "data" / "groundtruth.txt", "no <truth> & nothing\n");
  const SlamRun broken(temp / "data", temp / "broken");
  EXPECT_EQ(broken.finished.exit_code, 0) << "a broken truth spoils no run";
  const std::string note = read_text(broken.out / "report.html");
  expect_sound(note);
  EXPECT_NE(note.find("No error is given: "), std::string::npos);
}

}  // namespace
}  // namespace dkb::test
