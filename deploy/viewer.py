"""stub for now"""
raise ImportError
