// SPDX-License-Identifier: Apache-2.0
#include "bench/bench_plots.h"

#include <fmt/format.h>

#include <algorithm>

#include "bench/bench_charts.h"
#include "dkb/dataset/trajectory_file.h"
#include "dkb/util/errors.h"

namespace dkb::bench {
namespace fs = std::filesystem;
namespace {

struct Figure {
  const char* name;
  double ErrorStatistics::*value;
};
constexpr Figure kFigures[] = {{"rmse", &ErrorStatistics::rmse},     {"mean", &ErrorStatistics::mean},
                               {"median", &ErrorStatistics::median}, {"std", &ErrorStatistics::std},
                               {"min", &ErrorStatistics::min},       {"max", &ErrorStatistics::max}};

Bar bar_of(const MedianInterval& m) {
  Bar bar{m.median, {}};
  if (m.known) bar.whisker = {m.interval.low, m.interval.high};
  return bar;
}

std::optional<Bar> rmse_bar(const Cell& cell) {
  const std::vector<double> ape = cell.ape();
  return ape.empty() ? std::nullopt : std::optional(bar_of(median_interval(ape)));
}

// The run whose APE is the (lower) median.
const RunRecord* middle_run(const Cell& cell) {
  std::vector<const RunRecord*> runs;
  for (const RunRecord& r : cell.finished)
    if (r.ape) runs.push_back(&r);
  std::stable_sort(runs.begin(), runs.end(), [](const RunRecord* a, const RunRecord* b) {
    return a->ape->translation_m.rmse < b->ape->translation_m.rmse;
  });
  return runs.empty() ? nullptr : runs[(runs.size() - 1) / 2];
}

class Plotter {
 public:
  Plotter(const ResultsFolder& folder, const Results& results) : folder_(folder), results_(results) {
    const Suite& suite = *results.suite;
    for (size_t v = 0; v < suite.variants.size(); ++v) {
      const std::string& name = suite.variants[v].name;
      if (!suite.plotted.empty() && std::find(suite.plotted.begin(), suite.plotted.end(), name) == suite.plotted.end())
        continue;
      if (!results.shows(v)) continue;
      variants_.push_back(v);
      names_.push_back(name);
    }
  }

  std::map<std::string, std::string> plots() const {
    std::map<std::string, std::string> result;
    std::vector<BarPanel> overview;
    for (size_t s = 0; s < results_.suite->sequences.size(); ++s) {
      const std::string& name = results_.suite->sequences[s].name;
      BarPanel panel{name, {{"median, 95% interval", {}}}};
      for (const size_t v : variants_) panel.groups[0].bars.push_back(rmse_bar(cell(s, v)));
      const auto& bars = panel.groups[0].bars;
      if (std::none_of(bars.begin(), bars.end(), [](const auto& bar) { return bar.has_value(); })) continue;
      overview.push_back(std::move(panel));
      result[name + "-bars.svg"] = bar_panels_svg("APE on " + name, "APE [m]", names_, {figures_panel(s)});
      if (auto paths = paths_plot(s); !paths.empty()) result[name + "-paths.svg"] = std::move(paths);
    }
    if (!overview.empty()) result["ape.svg"] = bar_panels_svg("APE, rmse", "APE [m]", names_, overview);
    if (!results_.sweep.empty()) result["sweep.svg"] = sweep_plot();
    return result;
  }

 private:
  const Cell& cell(size_t sequence, size_t variant) const {
    return results_.cells[sequence * results_.suite->variants.size() + variant];
  }

  BarPanel figures_panel(size_t s) const {
    BarPanel panel{"medians over the runs", {}};
    for (const Figure& figure : kFigures) {
      BarGroup group{figure.name, {}};
      for (const size_t v : variants_) {
        const auto values = cell(s, v).values([&](const RunRecord& r) {
          return r.ape ? std::optional<double>(r.ape->translation_m.*figure.value) : std::nullopt;
        });
        group.bars.push_back(values.empty() ? std::nullopt : std::optional<Bar>(Bar{median_of(values), {}}));
      }
      panel.groups.push_back(std::move(group));
    }
    return panel;
  }

  std::string paths_plot(size_t s) const {
    std::error_code ignored;
    if (!fs::exists(folder_.truth_path(s), ignored)) return "";
    const Trajectory truth = read_truth(folder_.truth_path(s));
    std::vector<ComparedPath> paths;
    for (size_t k = 0; k < variants_.size(); ++k) {
      const RunRecord* run = middle_run(cell(s, variants_[k]));
      const fs::path file = run == nullptr ? fs::path() : folder_.trajectory_path({s, variants_[k], run->seed});
      if (run == nullptr || !fs::exists(file, ignored)) continue;
      paths.push_back({names_[k], k, evaluate(truth, read_trajectory(file))});
    }
    const std::string title = fmt::format("Paths on {}", results_.suite->sequences[s].name);
    return paths.empty() ? "" : compared_paths_svg(title, truth, paths);
  }

  std::string sweep_plot() const {
    const SuiteSweep& sweep = *results_.suite->sweep;
    std::vector<std::string> names;
    for (const double value : sweep.values) names.push_back(fmt::format("{} = {:g}", sweep.label, value));
    std::vector<BarPanel> panels;
    for (const SweepResult& s : results_.sweep) {
      BarPanel panel{s.sequence, {{"median, 95% interval", {}}}};
      for (const MedianInterval& m : s.ape) panel.groups[0].bars.emplace_back(bar_of(m));
      panels.push_back(std::move(panel));
    }
    return bar_panels_svg("Sensitivity to " + sweep.label, "APE [m]", names, panels);
  }

  const ResultsFolder& folder_;
  const Results& results_;
  std::vector<size_t> variants_;
  std::vector<std::string> names_;
};

}  // namespace

std::map<std::string, std::string> make_plots(const ResultsFolder& folder, const Results& results) {
  return Plotter(folder, results).plots();
}

}  // namespace dkb::bench
