// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dkb::report {

// Colours of Okabe and Ito, which the colour-blind tell apart; lines differ in width or dashes as well, and features in
// shape. Paper is always light.
inline constexpr const char* kPageStyle = R"(
:root{--paper:#fff;--card:#f6f8fa;--ink:#1f2328;--dim:#59636e;--line:#8c959f;--grid:#dfe3e8;--est:#0072b2;--truth:#a9b0b8;
--second:#c25a00;--free:#a5d8c6;--occupied:#c25a00;--good:#00795a;--bad:#b84a00;--pred:#a3467e}
@media screen and (prefers-color-scheme:dark){:root{--paper:#0f1318;--card:#181d24;--ink:#e6e9ed;--dim:#a3acb7;
--line:#6b7682;--grid:#2c343d;--est:#5cb6f0;--truth:#6f7a86;--second:#f0a040;--free:#1c5a49;--occupied:#f0a040;--good:#35c79a;--bad:#ff8a4c;--pred:#e08fc0}
:root{color-scheme:dark}}
*{box-sizing:border-box}
body{margin:0 auto;padding:0 20px 40px;max-width:1240px;background:var(--paper);color:var(--ink);
font:15px/1.5 system-ui,-apple-system,"Segoe UI",Helvetica,Arial,sans-serif;overflow-wrap:anywhere}
header{padding:22px 0 0}
h1{font-size:26px;line-height:1.25;margin:2px 0 6px}
h2{font-size:19px;margin:34px 0 8px;padding-top:10px;border-top:1px solid var(--grid)}
p{margin:6px 0 12px;max-width:78ch}
.dim,figcaption{color:var(--dim)}
nav{display:flex;flex-wrap:wrap;gap:4px 16px;font-size:14px;margin:6px 0 0}
a{color:var(--est)}
a:focus-visible{outline:2px solid var(--est);outline-offset:2px}
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(165px,1fr));gap:10px;margin:16px 0}
.tile{background:var(--card);border:1px solid var(--grid);border-left:5px solid var(--line);border-radius:6px;padding:9px 12px}
.tile.good{border-left-color:var(--good)}
.tile.bad{border-left-color:var(--bad)}
.tile .name{font-size:13px;color:var(--dim)}
.tile .value{font-size:22px;font-weight:600;line-height:1.3}
.tile .more{font-size:13px;color:var(--dim);line-height:1.35}
.grid{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,440px),1fr));gap:14px 18px}
.grid.maps{grid-template-columns:repeat(auto-fill,minmax(min(100%,440px),1fr))}
.grid.three{grid-template-columns:repeat(auto-fit,minmax(min(100%,340px),1fr))}
figure{margin:0;break-inside:avoid}
figcaption{font-size:13px;line-height:1.4;padding:4px 0 0}
figcaption b{color:var(--ink)}
svg{display:block;width:100%;height:auto;font-family:inherit}
svg text{fill:var(--ink);font-size:11.5px}
svg text.title{font-size:13.5px;font-weight:600}
svg text.halo{paint-order:stroke;stroke:var(--paper);stroke-width:3px;stroke-linejoin:round}
svg [stroke="#24292f"]{stroke:var(--line)}
svg [stroke="#e6e8eb"],svg line.grid,.line.grid{stroke:var(--grid)}
.line{fill:none;stroke-width:1.7;stroke-linejoin:round;stroke-linecap:round}
svg .line.est{stroke:var(--est)}
svg .line.truth{stroke:var(--truth);stroke-width:4}
svg .line.second{stroke:var(--second);stroke-dasharray:5 3}
svg .line.removed{stroke:var(--pred);stroke-dasharray:1.5 3}
svg .line.error{stroke:var(--second)}
svg .line.shadow{stroke:var(--dim);stroke-width:1;opacity:.55}
svg .line.grid{stroke-width:1}
.cloud,.keys{fill:none;stroke:var(--dim)}
.cloud{opacity:.65}
.keys{stroke:var(--second);stroke-width:4.5;stroke-linecap:round}
.free{fill:var(--free);stroke:none}
.occupied{fill:var(--occupied);stroke:none}
.unknown{fill:var(--grid);stroke:none}
svg .line.cloud{stroke:var(--dim)}
svg .line.keys{stroke:var(--second);stroke-width:4.5}
svg .line.free{stroke:var(--free);stroke-width:9;stroke-linecap:butt}
svg .line.occupied{stroke:var(--occupied);stroke-width:9;stroke-linecap:butt}
svg .line.unknown{stroke:var(--grid);stroke-width:9;stroke-linecap:butt}
.scale{fill:none;stroke:var(--ink);stroke-width:1.4}
.start{fill:var(--est);stroke:var(--paper);stroke-width:1.5}
.level,.budget{stroke:var(--ink);stroke-width:1.4;stroke-dasharray:6 4}
.bars{fill:var(--est)}
.tick{fill:none;stroke:var(--est);stroke-width:1.6}
.band.lost{fill:var(--bad);opacity:.28}
.band.predicted{fill:var(--pred);opacity:.28}
.band.initialising{fill:var(--line);opacity:.28}
.overlay{border-radius:4px;background:#000;outline:1px solid var(--grid)}
.overlay path{fill:none;stroke-linecap:round;stroke-width:3}
.overlay .used{stroke:#1de9b6}
.overlay .unused{stroke:#fff;stroke-width:1.6;opacity:.75}
.overlay .outlier{stroke:#ffd600;stroke-width:1.3}
.overlay .dynamic{fill:#ff5a1f;stroke:#000;stroke-width:.4}
.overlay .mask{fill:#2f6bff;fill-opacity:.42}
.overlay rect.box{fill:none;stroke:#fff;stroke-width:1.2;stroke-dasharray:4 2}
.overlay text.box{fill:#fff;font-size:10px;paint-order:stroke;stroke:#000;stroke-width:2px}
.key{display:flex;flex-wrap:wrap;gap:4px 20px;font-size:14px;margin:4px 0 12px}
.key svg{display:inline-block;width:22px;height:16px;vertical-align:-3px;margin-right:5px;background:#3b434c;border-radius:3px}
.stretch{display:grid;grid-template-columns:minmax(0,240px) 1fr;gap:14px;margin:12px 0;align-items:start;break-inside:avoid}
.stretch.bare{grid-template-columns:1fr}
.stretch p{margin:0 0 4px}
.cause{font-weight:600;font-size:17px}
.wide{overflow-x:auto}
table{border-collapse:collapse;font-size:14px;margin:6px 0 14px}
th,td{border-bottom:1px solid var(--grid);padding:4px 12px 4px 0;text-align:left;vertical-align:top}
td,th{overflow-wrap:normal}
th{color:var(--dim);font-weight:600}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
@media (min-width:601px){.three svg:not(.overlay) text{font-size:14.5px}.three svg:not(.overlay) text.title{font-size:16.5px}}
@media (max-width:600px){.grid.pictures{grid-template-columns:1fr 1fr;gap:10px}body{padding:0 12px 30px}h1{font-size:21px}.tiles{grid-template-columns:1fr 1fr;gap:8px}
.tile .value{font-size:19px}svg text{font-size:13px}svg text.title{font-size:15px}.stretch{grid-template-columns:1fr}}
@media print{body{max-width:none;padding:0;font-size:11pt}nav{display:none}h2,h2+p,.key{break-after:avoid}table{break-inside:avoid}.tile{break-inside:avoid}
.grid{grid-template-columns:1fr 1fr}.grid.three{grid-template-columns:1fr 1fr 1fr}.tiles{grid-template-columns:repeat(4,1fr)}
*{print-color-adjust:exact;-webkit-print-color-adjust:exact}}
@page{margin:14mm}
)";

}  // namespace dkb::report
