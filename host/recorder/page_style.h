// Style sheet of a session's page, for the screen and for A4.
#pragma once

namespace torquer {

inline constexpr char kPageStyle[] = R"css(
body{margin:0;background:#eef1f5;color:#1a2430;font:15px/1.45 'DejaVu Sans',Verdana,sans-serif}
main{max-width:1000px;margin:0 auto;padding:24px 28px 40px;background:#fff}
h1{font-size:25px;margin:0 0 4px}
h2{font-size:18px;margin:30px 0 10px;padding-bottom:4px;border-bottom:2px solid #1a2430}
h3{font-size:15px;margin:0 0 6px}
p{margin:6px 0}
.facts{color:#44505d;margin:0}
.verdict{margin:18px 0 12px;padding:12px 18px;border:2px solid;border-left-width:12px;border-radius:4px}
.verdict strong{display:block;font-size:21px}
.good{border-color:#00785a;background:#edf7f3}
.poor{border-color:#a3123a;background:#fbeff2}
.open{border-color:#566270;background:#f3f5f7}
.note{padding:8px 14px;border-left:6px solid #b25000;background:#fdf4ea}
table{border-collapse:collapse;width:100%}
.findings{margin-top:1rem}
th,td{text-align:left;vertical-align:top;padding:5px 10px 5px 0;border-bottom:1px solid #d5dbe2}
th{font-weight:bold}
td.number{font-variant-numeric:tabular-nums}
.findings td.number,.sessions td{white-space:nowrap}
.sessions{font-size:13px}
.columns{display:grid;grid-template-columns:1fr 1fr;gap:22px 34px}
.columns table{table-layout:fixed}
.columns td:first-child{width:54%}
figure{margin:8px 0}
figcaption,.small{font-size:13px;color:#44505d}
.picture svg{display:block;width:100%;height:auto}
@page{size:A4;margin:13mm}
@media (max-width:700px){.columns{grid-template-columns:1fr}main{padding:16px}section{overflow-x:auto}
.findings td.number,.sessions td{white-space:normal}}
@media print{
body{background:#fff;font-size:9pt;line-height:1.35}
th,td{padding:2.5px 8px 2.5px 0}
.verdict{margin:8px 0;padding:7px 14px}
main{max-width:none;padding:0}
h1{font-size:17pt}h2{font-size:12.5pt;margin:16px 0 8px}h3{font-size:10pt}
.verdict strong{font-size:14pt}
figcaption,.small,.sessions{font-size:8pt}
h2,h3{break-after:avoid}
section.whole,figure,table,.verdict,.columns>div{break-inside:avoid}
.verdict,.note,svg{print-color-adjust:exact;-webkit-print-color-adjust:exact}
}
)css";

}  // namespace torquer
