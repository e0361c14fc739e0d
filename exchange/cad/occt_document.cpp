#include "exchange/cad/occt_document.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <map>
#include <opencascade/APIHeaderSection_MakeHeader.hxx>
#include <opencascade/IGESCAFControl_Reader.hxx>
#include <opencascade/IGESData_GlobalSection.hxx>
#include <opencascade/IGESData_IGESEntity.hxx>
#include <opencascade/IGESData_IGESModel.hxx>
#include <opencascade/Interface_Static.hxx>
#include <opencascade/STEPCAFControl_Reader.hxx>
#include <opencascade/STEPConstruct_ExternRefs.hxx>
#include <opencascade/STEPControl_Reader.hxx>
#include <opencascade/StepBasic_Product.hxx>
#include <opencascade/StepBasic_ProductDefinition.hxx>
#include <opencascade/StepBasic_ProductDefinitionFormation.hxx>
#include <opencascade/StepData_StepModel.hxx>
#include <opencascade/StepData_UndefinedEntity.hxx>
#include <opencascade/StepGeom_Curve.hxx>
#include <opencascade/StepRepr_NextAssemblyUsageOccurrence.hxx>
#include <opencascade/StepRepr_RepresentationItem.hxx>
#include <opencascade/StepShape_EdgeCurve.hxx>
#include <opencascade/StepShape_ManifoldSolidBrep.hxx>
#include <opencascade/StepShape_ShellBasedSurfaceModel.hxx>
#include <opencascade/TColStd_SequenceOfAsciiString.hxx>
#include <opencascade/TransferBRep.hxx>
#include <opencascade/Transfer_TransientProcess.hxx>
#include <opencascade/XCAFApp_Application.hxx>
#include <opencascade/XCAFDoc_DocumentTool.hxx>
#include <opencascade/XCAFDoc_ShapeTool.hxx>
#include <opencascade/XSControl_TransferReader.hxx>
#include <opencascade/XSControl_WorkSession.hxx>
#include <set>
#include <string_view>
#include <utility>

#include "core/file.h"
#include "core/utf8.h"
#include "exchange/cad/step_places.h"
#include "scene/files/source_file.h"

namespace limn::cad {
namespace {

namespace fs = std::filesystem;

constexpr double k_read_percent = 30, k_transferred_percent = 60;

std::string text_of(const Handle(TCollection_HAsciiString) & text) {
  return text.IsNull() ? std::string() : as_utf8(text->ToCString());
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

Error damaged(const fs::path& path, const std::string& format, const std::string& found) {
  return error("{}: expected a whole {} file with shapes, found {}. Export it again.", path.string(), format,
               found);
}

// The file as it is before it is read: what is read later may be another file of that name.
CadSource source_of(const fs::path& path) {
  return {as_utf8(path.filename().string()), scene::file_fingerprint(path)};
}

// ---- STEP

std::string step_schema(const Handle(StepData_StepModel) & model) {
  const APIHeaderSection_MakeHeader header(model);
  if (!header.HasFs() || header.NbSchemaIdentifiers() < 1) return "";
  std::string stated = text_of(header.SchemaIdentifiersValue(1));
  const std::string name = lower(stated);
  const auto has = [&](const char* word) { return name.find(word) != std::string::npos; };
  if (has("ap242") || has("managed_model")) return "AP242";
  if (has("ap214") || has("automotive_design")) return "AP214";
  if (has("ap203") || has("config_control") || has("configuration_control")) return "AP203";
  return stated;
}

struct NamedUnit {
  const char* name;
  double metres;
};

// The names of length units that OpenCASCADE reports for STEP files.
constexpr NamedUnit k_step_units[] = {{"millimetre", 1e-3}, {"millimeter", 1e-3}, {"mm", 1e-3},
                                      {"centimetre", 1e-2}, {"centimeter", 1e-2}, {"cm", 1e-2},
                                      {"metre", 1},         {"meter", 1},         {"m", 1},
                                      {"inch", 0.0254},     {"in", 0.0254},       {"foot", 0.3048},
                                      {"ft", 0.3048},       {"micrometre", 1e-6}, {"kilometre", 1e3},
                                      {"decimetre", 0.1},   {"mile", 1609.344},   {"mil", 2.54e-5}};

void read_step_unit(STEPControl_Reader& reader, OcctDocument* out) {
  TColStd_SequenceOfAsciiString lengths, angles, solid_angles;
  reader.FileUnits(lengths, angles, solid_angles);
  std::set<std::string> names;
  for (const TCollection_AsciiString& length : lengths) names.insert(lower(as_utf8(length.ToCString())));
  if (names.empty()) {
    out->warnings.push_back("the file states no length unit; millimetres are assumed");
    return;
  }
  out->unit = lower(as_utf8(lengths.First().ToCString()));
  if (names.size() > 1)
    out->warnings.push_back("parts of the file are in different units; each keeps its own");
  const auto* const known = std::find_if(std::begin(k_step_units), std::end(k_step_units),
                                         [&](const NamedUnit& unit) { return out->unit == unit.name; });
  if (known != std::end(k_step_units)) out->metres_per_unit = known->metres;
}

std::string product_name(const Handle(StepBasic_ProductDefinition) & definition) {
  if (definition.IsNull() || definition->Formation().IsNull() ||
      definition->Formation()->OfProduct().IsNull())
    return "?";
  return text_of(definition->Formation()->OfProduct()->Name());
}

using Products = std::map<const Standard_Transient*, std::vector<Handle(StepBasic_ProductDefinition)>>;

// The names along a way from `at` that comes back to itself; empty: there is none. OpenCASCADE would follow
// such a way until memory ends.
std::string circle_from(const Handle(StepBasic_ProductDefinition) & at,
                        const Products& inside,
                        std::vector<const Standard_Transient*>* way,
                        std::set<const Standard_Transient*>* done) {
  if (std::find(way->begin(), way->end(), at.get()) != way->end()) return product_name(at);
  const auto parts = inside.find(at.get());
  if (parts == inside.end() || done->contains(at.get())) return "";
  if (way->size() > 1000) return product_name(at) + ", in more than 1000 levels";
  way->push_back(at.get());
  for (const auto& part : parts->second)
    if (const std::string circle = circle_from(part, inside, way, done); !circle.empty())
      return product_name(at) + " -> " + circle;
  way->pop_back();
  done->insert(at.get());
  return "";
}

std::string circle_in(const Handle(StepData_StepModel) & model) {
  Products inside;
  std::vector<Handle(StepBasic_ProductDefinition)> all;
  for (Standard_Integer i = 1; i <= model->NbEntities(); ++i) {
    const auto use = Handle(StepRepr_NextAssemblyUsageOccurrence)::DownCast(model->Value(i));
    if (use.IsNull() || use->RelatingProductDefinition().IsNull() || use->RelatedProductDefinition().IsNull())
      continue;
    inside[use->RelatingProductDefinition().get()].push_back(use->RelatedProductDefinition());
    all.push_back(use->RelatingProductDefinition());
  }
  std::set<const Standard_Transient*> done;
  for (const auto& product : all) {
    std::vector<const Standard_Transient*> way;
    if (std::string circle = circle_from(product, inside, &way, &done); !circle.empty()) return circle;
  }
  return "";
}

// What a file may have instead of solids by their boundaries, by a part of the types' names.
constexpr std::pair<const char*, const char*> k_unread[] = {
    {"tessellatedsolid", "meshes (tessellated geometry)"},
    {"tessellatedshell", "meshes (tessellated geometry)"},
    {"csg", "CSG solids"},
    {"booleanresult", "CSG solids"},
    {"sweptarea", "swept areas"},
    {"extrudedarea", "swept areas"},
    {"revolvedarea", "swept areas"},
    {"sweptdisk", "swept areas"}};

std::string unread_shapes(const Handle(StepData_StepModel) & model) {
  std::set<std::string> found;
  for (Standard_Integer i = 1; i <= model->NbEntities(); ++i) {
    const auto unknown = Handle(StepData_UndefinedEntity)::DownCast(model->Value(i));
    std::string type = lower(unknown.IsNull() ? model->Value(i)->DynamicType()->Name() : unknown->StepType());
    std::erase(type, '_');
    for (const auto& [part, name] : k_unread)
      if (type.find(part) != std::string::npos) found.insert(name);
  }
  return fmt::format("{}", fmt::join(found, ", "));
}

// Names of the STEP entities that became solids, surface models or curves.
void read_shape_names(const Handle(XSControl_WorkSession) & session,
                      const Handle(StepData_StepModel) & model,
                      ShapeNames* names) {
  const Handle(Transfer_TransientProcess) process = session->TransferReader()->TransientProcess();
  for (Standard_Integer i = 1; i <= model->NbEntities(); ++i) {
    const Handle(Standard_Transient) entity = model->Value(i);
    if (!entity->IsKind(STANDARD_TYPE(StepShape_ManifoldSolidBrep)) &&
        !entity->IsKind(STANDARD_TYPE(StepShape_ShellBasedSurfaceModel)) &&
        !entity->IsKind(STANDARD_TYPE(StepGeom_Curve)) && !entity->IsKind(STANDARD_TYPE(StepShape_EdgeCurve)))
      continue;
    const TopoDS_Shape shape = TransferBRep::ShapeResult(process, entity);
    const std::string name = text_of(Handle(StepRepr_RepresentationItem)::DownCast(entity)->Name());
    if (!shape.IsNull() && !name.empty()) names->Bind(shape.Located(TopLoc_Location()), name);
  }
}

// The code page of a text that is not UTF-8. Chinese words (GBK) are at least two letters of two bytes each;
// Western European letters outside ASCII are seldom so many in a row, and seldom in even numbers everywhere.
const char* code_page(std::string_view text) {
  std::size_t run = 0, longest = 0;
  bool is_even = true;
  for (const char c : text) {
    const bool is_high = (static_cast<unsigned char>(c) & 0x80U) != 0;
    if (!is_high) is_even = is_even && run % 2 == 0;
    run = is_high ? run + 1 : 0;
    longest = std::max(longest, run);
  }
  return is_even && longest >= 4 ? "GBK" : "CP1252";
}

// Says in which code page names are. OpenCASCADE takes them as UTF-8.
Status set_code_page(const fs::path& path, OcctDocument* out) {
  LIMN_TRY(const std::string content, read_file(path));
  const std::string page = is_utf8(content) ? "UTF8" : code_page(content);
  // OpenCASCADE 7.6 has one name for both of China's code pages.
  if (!Interface_Static::SetCVal("read.step.codepage", page.c_str()))
    Interface_Static::SetCVal("read.step.codepage", "GB");
  if (page != "UTF8")
    out->warnings.push_back(fmt::format("names are not UTF-8, as STEP asks; they are taken as {}", page));
  return {};
}

// The STEP files that a model refers to, and those to which they refer in turn.
class References {
 public:
  References(const fs::path& path, OcctDocument* out) : path_(path), out_(out) {}

  // `folder` is the file's, relative to the first one's. OpenCASCADE opens whatever a name says.
  Status add(const Handle(XSControl_WorkSession) & session, const fs::path& folder) {
    STEPConstruct_ExternRefs stated(session);
    stated.LoadExternRefs();
    for (Standard_Integer i = 1; i <= stated.NbExternRefs(); ++i) {
      const Standard_CString name = stated.FileName(i);
      if (name && *name) LIMN_TRY_STATUS(add_file(name, folder));
    }
    return {};
  }

 private:
  Status add_file(std::string name, const fs::path& folder) {
    const bool is_inside = scene::stays_inside(name);
    std::replace(name.begin(), name.end(), '\\', '/');
    const fs::path own = (folder / name).lexically_normal();
    if (!known_.insert(own).second) return {};
    const fs::path file = path_.parent_path() / own;
    std::error_code none;
    const bool is_there = fs::exists(file, none);
    if (is_there && (!is_inside || !fs::is_regular_file(file, none)))
      return error(
          "{}: expected that it refers only to files in its folder, found '{}'. Put that file beside it.",
          path_.string(), as_utf8(name));
    if (!is_there)
      out_->warnings.push_back(
          fmt::format("'{}', a file that it refers to, is absent; its shapes are left out", as_utf8(name)));
    if (!is_inside) return {};
    out_->sources.push_back({as_utf8(own.string()), scene::file_fingerprint(file)});
    if (!is_there) return {};
    const Handle(XSControl_WorkSession) session = new XSControl_WorkSession;
    session->SelectNorm("STEP");
    STEPControl_Reader reader(session, Standard_False);
    if (reader.ReadFile(fs::absolute(file).c_str()) == IFSelect_RetDone)
      return add(session, own.parent_path());
    out_->warnings.push_back(fmt::format(
        "'{}', a file that it refers to, cannot be parsed; its shapes are left out", as_utf8(name)));
    return {};
  }

  const fs::path& path_;
  OcctDocument* out_;
  std::set<fs::path> known_;
};

// Also accepts a byte order mark of UTF-8, which STEP does not allow, but some programs write.
bool is_parsed(STEPControl_Reader* reader, const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string mark(3, '\0');
  file.read(mark.data(), std::ssize(mark));
  const auto parsed = mark == "\xEF\xBB\xBF" ? reader->ReadStream(path.filename().c_str(), file)
                                             : reader->ReadFile(fs::absolute(path).c_str());
  return parsed == IFSelect_RetDone;
}

Result<OcctDocument> read_step(const fs::path& path, ProgressLines* progress) {
  OcctDocument out{.document = new_document(), .format = "STEP", .sources = {source_of(path)}};
  STEPCAFControl_Reader reader;
  reader.SetLayerMode(false);
  reader.SetPropsMode(false);
  reader.SetGDTMode(false);
  reader.SetMatMode(false);
  reader.SetViewMode(false);
  LIMN_TRY_STATUS(set_code_page(path, &out));
  if (!is_parsed(&reader.ChangeReader(), path)) return damaged(path, "STEP", "one that cannot be parsed");
  const Handle(StepData_StepModel) model = reader.ChangeReader().StepModel();
  if (model.IsNull() || model->NbEntities() == 0) return damaged(path, "STEP", "no entities");
  out.schema = step_schema(model);
  read_step_unit(reader.ChangeReader(), &out);
  if (const std::string circle = circle_in(model); !circle.empty())
    return error("{}: expected an assembly that does not contain itself, found {}. Remove one of these uses.",
                 path.string(), circle);
  warn_of_places(model, &out.warnings);
  LIMN_TRY_STATUS(References(path, &out).add(reader.ChangeReader().WS(), {}));
  progress->begin_stage("translating", k_read_percent, k_transferred_percent);
  out.unread = unread_shapes(model);
  if (!reader.Transfer(out.document, progress->Start()) && out.unread.empty())
    return damaged(path, "STEP", "no shapes");
  read_shape_names(reader.ChangeReader().WS(), model, &out.shape_names);
  return out;
}

// ---- IGES

// The units by the numbers that IGES has for them, from 1; number 3 means that the unit is named.
constexpr std::array<const char*, 11> k_iges_units = {"inch",       "millimetre", "",          "foot",
                                                      "mile",       "metre",      "kilometre", "mil",
                                                      "micrometre", "centimetre", "microinch"};

void read_iges_unit(const IGESData_GlobalSection& global, OcctDocument* out) {
  const int number = global.UnitFlag();
  const std::string name = lower(text_of(global.UnitName()));
  const bool is_numbered = number >= 1 && number <= static_cast<int>(k_iges_units.size()) && number != 3;
  out->unit = is_numbered ? k_iges_units.at(static_cast<std::size_t>(number) - 1) : name;
  out->metres_per_unit = 1e-3 * global.UnitValue();
  const bool is_known = is_numbered || std::any_of(std::begin(k_step_units), std::end(k_step_units),
                                                   [&](const NamedUnit& unit) { return name == unit.name; });
  if (!is_known)
    out->warnings.push_back(
        fmt::format("the file's length unit '{}' (number {}) is unknown; {:.6g} mm are assumed", name, number,
                    1e3 * out->metres_per_unit));
}

// Whether the file's last line is that of its terminate section. OpenCASCADE takes what there is of a cut
// file.
bool has_iges_end(const std::string& content) {
  constexpr std::size_t k_section = 72;  // its letter's column
  const std::size_t end = content.find_last_not_of(std::string_view("\r\n \t\x1A\0", 6));
  if (end == std::string::npos) return false;
  const std::size_t begin = content.find_last_of("\r\n", end) + 1;  // npos + 1 is 0
  return end - begin >= k_section && content[begin + k_section] == 'T';
}

// Whether a name is empty, on which OpenCASCADE crashes when it reads names.
bool has_empty_name(const IGESData_IGESModel& model) {
  for (Standard_Integer i = 1; i <= model.NbEntities(); ++i) {
    const auto entity = Handle(IGESData_IGESEntity)::DownCast(model.Value(i));
    if (!entity.IsNull() && entity->HasName() && entity->NameValue().IsNull()) return true;
  }
  return false;
}

Result<OcctDocument> read_iges(const fs::path& path, ProgressLines* progress) {
  OcctDocument out{.document = new_document(), .format = "IGES", .sources = {source_of(path)}};
  LIMN_TRY(const std::string content, read_file(path));
  if (!has_iges_end(content)) return damaged(path, "IGES", "one whose end is missing");
  IGESCAFControl_Reader reader;
  reader.SetReadVisible(true);
  if (reader.ReadFile(fs::absolute(path).c_str()) != IFSelect_RetDone)
    return damaged(path, "IGES", "one that cannot be parsed");
  const auto model = Handle(IGESData_IGESModel)::DownCast(reader.Model());
  if (model.IsNull() || model->NbEntities() == 0) return damaged(path, "IGES", "no entities");
  const IGESData_GlobalSection& global = model->GlobalSection();
  read_iges_unit(global, &out);
  if (has_empty_name(*model)) {
    reader.SetNameMode(false);
    out.warnings.emplace_back("one of the names is empty; no names are read");
  }
  progress->begin_stage("translating", k_read_percent, k_transferred_percent);
  if (!reader.Transfer(out.document, progress->Start())) return damaged(path, "IGES", "no shapes");
  return out;
}

}  // namespace

std::string a_file(const std::string& format) {
  return (format == "IGES" ? "an IGES" : "a STEP") + std::string(" file");
}

Handle(TDocStd_Document) new_document() {
  Handle(TDocStd_Document) document;
  XCAFApp_Application::GetApplication()->NewDocument("BinXCAF", document);
  return document;
}

Result<OcctDocument> read_document(const fs::path& path, ProgressLines* progress) {
  const std::string end = lower(path.extension().string());
  progress->begin_stage("reading", 0, k_read_percent);
  if (end == ".step" || end == ".stp") return read_step(path, progress);
  if (end == ".iges" || end == ".igs") return read_iges(path, progress);
  return error("{}: expected a STEP or IGES file (.step, .stp, .iges or .igs), found '{}'.", path.string(),
               path.extension().string());
}

}  // namespace limn::cad
