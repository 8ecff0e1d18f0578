/* Configuration files: a YAML mapping "name: value" into parameters, by libyaml's document tree, whose nodes
 * know their line and column. What a value means is the parameter table's business; here is only what a file
 * adds: the shape of the document, duplicate keys, relative paths, a list of stimuli. */
#include "core/context.h"
#include "sph_muscle/io.h"

#ifndef SPHM_WITH_YAML

int sphm_io_has_yaml(void) {
    return 0;
}

sphm_status sphm_io_load_parameters(const char *path, sphm_parameters *parameters, sphm_context *context) {
    (void)parameters;
    return sphm_fail(
        context, SPHM_REFUSED_UNSUPPORTED,
        "cannot read '%s': this build has no YAML library (libyaml); set parameters one by one, or "
        "build with libyaml-dev installed",
        path ? path : "");
}

#else

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <yaml.h>

int sphm_io_has_yaml(void) {
    return 1;
}

/* One file being read: where messages point, and what they need. */
typedef struct reader {
    const char *path;
    yaml_document_t document;
    sphm_parameters parameters; /* a copy, handed over when the whole file was right */
    sphm_context *context;
} reader;

/* "FILE:LINE:COLUMN: ", the form editors jump to. libyaml counts from 0. */
#define AT "%s:%zu:%zu: "
#define AT_NODE(r, node) (r)->path, (node)->start_mark.line + 1, (node)->start_mark.column + 1

static const char *kind_of(const yaml_node_t *node) {
    switch (node->type) {
    case YAML_SCALAR_NODE:
        return "a single value";
    case YAML_SEQUENCE_NODE:
        return "a list";
    case YAML_MAPPING_NODE:
        return "a nested map";
    default:
        return "nothing";
    }
}

/* The text of a scalar, or NULL for anything else and for text with a NUL byte in it. */
static const char *scalar(const yaml_node_t *node) {
    if (!node || node->type != YAML_SCALAR_NODE)
        return NULL;
    const char *text = (const char *)node->data.scalar.value;
    if (strlen(text) != node->data.scalar.length)
        return NULL;
    int plain = node->data.scalar.style == YAML_PLAIN_SCALAR_STYLE;
    return plain && (strcmp(text, "~") == 0 || strcmp(text, "null") == 0) ? "" : text;
}

/* Appends to a text of SPHM_TEXT_SIZE bytes; 0 if it does not fit. */
static int append(char *text, const char *more) {
    size_t used = strlen(text), length = strlen(more);
    if (used + length >= SPHM_TEXT_SIZE)
        return 0;
    memcpy(text + used, more, length + 1);
    return 1;
}

/* A list of scalars as "BEFORE a SEPARATOR b ... AFTER". */
static sphm_status join(reader *r, const yaml_node_t *list, const char *before, const char *separator,
                        const char *after, char text[SPHM_TEXT_SIZE]) {
    text[0] = '\0';
    int fits = append(text, before);
    for (yaml_node_item_t *item = list->data.sequence.items.start; item < list->data.sequence.items.top;
         item++) {
        const yaml_node_t *node = yaml_document_get_node(&r->document, *item);
        const char *value = scalar(node);
        if (!value)
            return sphm_fail(r->context, SPHM_REFUSED_PARAMETER,
                             AT "an entry of this list is %s; it must be a single value", AT_NODE(r, node),
                             kind_of(node));
        if (item > list->data.sequence.items.start)
            fits = fits && append(text, separator);
        fits = fits && append(text, value);
    }
    if (!fits || !append(text, after))
        return sphm_fail(r->context, SPHM_REFUSED_PARAMETER, AT "this list is longer than %d bytes",
                         AT_NODE(r, list), SPHM_TEXT_SIZE - 1);
    return SPHM_OK;
}

/* A value node as the text that sphm_parameters_set() takes. */
static sphm_status value_text(reader *r, const sphm_parameter_info *row, const yaml_node_t *node,
                              char text[SPHM_TEXT_SIZE]) {
    int is_list = node->type == YAML_SEQUENCE_NODE;
    if (is_list && row->kind == SPHM_KIND_VECTOR)
        return join(r, node, "[", ", ", "]", text);
    if (is_list && strcmp(row->name, "stimulus") == 0)
        return join(r, node, "", "; ", "", text);
    const char *value = scalar(node);
    if (!value)
        return sphm_fail(r->context, SPHM_REFUSED_PARAMETER, AT "parameter '%s' is %s; it must be %s",
                         AT_NODE(r, node), row->name,
                         node->type == YAML_SCALAR_NODE ? "text with a zero byte" : kind_of(node),
                         row->kind == SPHM_KIND_VECTOR ? "[x, y, z]" : "a single value");
    text[0] = '\0';
    if (!append(text, value))
        return sphm_fail(r->context, SPHM_REFUSED_PARAMETER, AT "parameter '%s' is longer than %d bytes",
                         AT_NODE(r, node), row->name, SPHM_TEXT_SIZE - 1);
    return SPHM_OK;
}

static int is_path(const sphm_parameter_info *row) {
    return strcmp(row->name, "mesh") == 0 || strcmp(row->name, "fibre_file") == 0;
}

/* Puts the folder of the YAML file before a relative path. URLs (package://...) are left to who knows them.
 */
static sphm_status resolve_path(reader *r, const yaml_node_t *node, char text[SPHM_TEXT_SIZE]) {
    const char *slash = strrchr(r->path, '/');
    if (text[0] == '\0' || text[0] == '/' || strstr(text, "://") || !slash)
        return SPHM_OK;
    char relative[SPHM_TEXT_SIZE];
    strcpy(relative, text);
    int length = snprintf(text, SPHM_TEXT_SIZE, "%.*s%s", (int)(slash - r->path + 1), r->path, relative);
    if (length < 0 || length >= SPHM_TEXT_SIZE)
        return sphm_fail(r->context, SPHM_REFUSED_PARAMETER,
                         AT "the path with its folder is longer than %d bytes", AT_NODE(r, node),
                         SPHM_TEXT_SIZE - 1);
    return SPHM_OK;
}

/* Puts the place before the message that is there. */
static sphm_status refuse_at(reader *r, const yaml_node_t *node, sphm_status status) {
    if (!r->context)
        return status;
    char message[sizeof r->context->message];
    strcpy(message, r->context->message);
    return sphm_fail(r->context, status, AT "%s", AT_NODE(r, node), message);
}

static sphm_status set_pair(reader *r, const yaml_node_t *key, const yaml_node_t *value) {
    const char *name = scalar(key);
    if (!name)
        return sphm_fail(r->context, SPHM_REFUSED_PARAMETER,
                         AT "a key is %s; it must be the name of a parameter", AT_NODE(r, key), kind_of(key));
    const sphm_parameter_info *row = sphm_parameter_find(name);
    if (!row) /* the table words the refusal */
        return refuse_at(r, key, sphm_parameters_set(&r->parameters, name, "", r->context));
    char text[SPHM_TEXT_SIZE];
    sphm_status status = value_text(r, row, value, text);
    if (status == SPHM_OK && is_path(row))
        status = resolve_path(r, value, text);
    if (status != SPHM_OK)
        return status;
    status = sphm_parameters_set(&r->parameters, name, text, r->context);
    return status == SPHM_OK ? status : refuse_at(r, value, status);
}

static sphm_status refuse_duplicate(reader *r, const yaml_node_t *root, const yaml_node_pair_t *pair) {
    const yaml_node_t *key = yaml_document_get_node(&r->document, pair->key);
    for (const yaml_node_pair_t *p = root->data.mapping.pairs.start; p < pair; p++) {
        const yaml_node_t *earlier = yaml_document_get_node(&r->document, p->key);
        if (scalar(key) && scalar(earlier) && strcmp(scalar(key), scalar(earlier)) == 0)
            return sphm_fail(r->context, SPHM_REFUSED_PARAMETER,
                             AT "parameter '%.60s' is given twice; the first time in line %zu",
                             AT_NODE(r, key), scalar(key), earlier->start_mark.line + 1);
    }
    return SPHM_OK;
}

static sphm_status read_mapping(reader *r) {
    const yaml_node_t *root = yaml_document_get_root_node(&r->document);
    if (!root || (root->type == YAML_SCALAR_NODE && scalar(root) && !scalar(root)[0]))
        return SPHM_OK; /* nothing but comments: the defaults, by intention */
    if (root->type != YAML_MAPPING_NODE)
        return sphm_fail(r->context, SPHM_REFUSED_FILE,
                         AT "the file holds %s; it must be a map of lines 'name: value'", AT_NODE(r, root),
                         kind_of(root));
    for (const yaml_node_pair_t *pair = root->data.mapping.pairs.start; pair < root->data.mapping.pairs.top;
         pair++) {
        sphm_status status = refuse_duplicate(r, root, pair);
        if (status == SPHM_OK)
            status = set_pair(r, yaml_document_get_node(&r->document, pair->key),
                              yaml_document_get_node(&r->document, pair->value));
        if (status != SPHM_OK)
            return status;
    }
    return SPHM_OK;
}

static sphm_status refuse_yaml(const reader *r, const yaml_parser_t *parser) {
    const char *problem = parser->problem ? parser->problem : "out of memory";
    if (parser->error == YAML_MEMORY_ERROR)
        return sphm_fail(r->context, SPHM_REFUSED_MEMORY, "%s: out of memory", r->path);
    if (parser->error == YAML_READER_ERROR)
        return sphm_fail(r->context, SPHM_REFUSED_FILE, "%s: byte %zu: %s; the file must be UTF-8 text",
                         r->path, parser->problem_offset, problem);
    return sphm_fail(r->context, SPHM_REFUSED_FILE, AT "not YAML: %s%s%s", r->path,
                     parser->problem_mark.line + 1, parser->problem_mark.column + 1, problem,
                     parser->context ? " " : "", parser->context ? parser->context : "");
}

/* Only the first document of a file can be meant; a second one would be silently lost. */
static sphm_status refuse_second_document(const reader *r, yaml_parser_t *parser) {
    yaml_document_t second;
    if (!yaml_parser_load(parser, &second))
        return refuse_yaml(r, parser);
    const yaml_node_t *root = yaml_document_get_root_node(&second);
    sphm_status status = SPHM_OK;
    if (root)
        status = sphm_fail(r->context, SPHM_REFUSED_FILE,
                           AT "a second document begins here; a file holds one", AT_NODE(r, root));
    yaml_document_delete(&second);
    return status;
}

static sphm_status read_document(reader *r, yaml_parser_t *parser) {
    if (!yaml_parser_load(parser, &r->document))
        return refuse_yaml(r, parser);
    sphm_status status = read_mapping(r);
    if (status == SPHM_OK && yaml_document_get_root_node(&r->document))
        status = refuse_second_document(r, parser);
    yaml_document_delete(&r->document);
    return status;
}

sphm_status sphm_io_load_parameters(const char *path, sphm_parameters *parameters, sphm_context *context) {
    if (!path || !parameters)
        return sphm_fail(context, SPHM_REFUSED_ARGUMENT, "path or parameters are NULL");
    reader r;
    memset(&r, 0, sizeof r);
    r.path = path;
    r.parameters = *parameters;
    r.context = context;
    yaml_parser_t parser;
    FILE *file = fopen(path, "rb");
    if (!file)
        return sphm_fail(context, SPHM_REFUSED_FILE, "cannot read '%s': %s", path, strerror(errno));
    if (!yaml_parser_initialize(&parser)) {
        fclose(file);
        return sphm_fail(context, SPHM_REFUSED_MEMORY, "%s: out of memory", path);
    }
    yaml_parser_set_input_file(&parser, file);
    sphm_status status = read_document(&r, &parser);
    yaml_parser_delete(&parser);
    fclose(file);
    if (status == SPHM_OK)
        *parameters = r.parameters;
    return status;
}

#endif
